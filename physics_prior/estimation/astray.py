"""Parts that went astray: most of what is seen of one the gate refuses, while it believes the rest of the frame.

So it is after a gap in which too little of a part was seen: a head of one marker may turn about it unseen. Its markers come
back too far off to be believed, each by itself and for ever, for the covariance knows nothing of it. As long as the estimate is
trusted without an accepted measurement (``health: degraded_after``), they may be wrong labels; then it is the part that is.
"""

from collections.abc import Mapping

import numpy as np

Suspects = Mapping[int, int]
"""Link -> since which stamp, ns, most of its markers were refused in each frame that showed any."""
MOST = 0.5  # of a part's markers that are seen


def suspects(
    before: Suspects, stamp: int, patience: int, links: np.ndarray, believed: np.ndarray
) -> tuple[dict[int, int], np.ndarray]:
    """Those after a frame at a stamp, and which of its markers (k,) are on parts that were suspect for ``patience``, ns.

    links, believed: (k,) where the markers are, and whether the gate believed them.
    """
    refused = [link for link in np.unique(links[~believed]).tolist() if np.mean(believed[links == link]) < MOST]
    since = {link: before.get(link, stamp) for link in refused}
    lost = [link for link in refused if stamp - since[link] >= patience]
    unseen = {link: begin for link, begin in before.items() if link not in links}
    return unseen | {link: since[link] for link in refused if link not in lost}, np.isin(links, lost)
