"""Where two convex shapes touch or soon will: `pairs.touch` fills a manifold of point pairs (docs/contact.md)."""
