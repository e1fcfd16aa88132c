"""YAML reading: values, lines, and files that mean harm."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from physics_prior.errors import SceneError
from physics_prior.scene.yaml_file import MAXIMUM_BYTES, read_yaml


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("yaml")


@pytest.fixture
def read(folder):
    def read(text: str | bytes):
        path = folder / "scene.yaml"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return read_yaml(path)

    return read


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-4", 1e-4),  # a text in YAML 1.1
        ("-.5", -0.5),
        ("12", 12),
        ("1e3", 1000),
        ("1:30", "1:30"),  # 90 in YAML 1.1
        ("0x10", "0x10"),
        ("1_000", "1_000"),
        ("yes", "yes"),
        ("y", "y"),
        ("true", True),
        ("'true'", "true"),
        ("'5'", "5"),
        ("~", None),
        ("", None),
        ("2001-01-01", "2001-01-01"),
        ("[a, [b], {c: d}]", ["a", ["b"], {"c": "d"}]),
    ],
)
def test_values(read, text, value):
    read_value = read(f"key: {text}\n")["key"].value
    assert read_value == value
    assert type(read_value) is type(value)


def test_every_value_knows_the_line_of_its_key(read):
    top = read("a: 1\n\nb:\n  - x\n  - y: 2\n    z: &t {p: 1,\n         q: 2}\nc: *t\n")
    lines = {
        ("a",): 1,
        ("b",): 3,
        ("b", 0): 4,
        ("b", 1): 5,
        ("b", 1, "z"): 6,
        ("b", 1, "z", "q"): 7,
        ("c",): 8,
        ("c", "q"): 7,  # behind an alias: where it is written
    }
    for location, line in lines.items():
        place = top.inside(location)
        assert place.location == location
        assert f"scene.yaml:{line}: " in str(place.error("."))
    assert top.inside(("b", 7, "z")).location == ("b",)
    assert top.inside(("a", 0)).location == ("a",)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", 1, "is empty"),
        ("# nothing\n", 1, "is empty"),
        ("- a\n", 1, "is not a scene"),
        ("a: 1\nb: 2\na: 3\n", 3, "key 'a' is given twice, on line 1 too"),
        ("a:\n  - .nan\n", 2, "a[0]: .nan is not a finite number"),
        ("a: -.INF\n", 1, "-.INF is not a finite number"),
        ("a: 1\nb: {c: 1e999}\n", 2, "b.c: 1e999 is too large"),
        ("a: !!python/object/apply:os.system ['true']\n", 1, "is refused"),
        ("a: !!float nan\n", 1, "is refused"),
        ("a: 1\n---\nb: 1\n", 2, "a second document"),
        ("a: 1\nb: *a\n", 2, "alias *a is unknown"),
        ("a: &a [*a]\n", 1, "alias *a is unknown"),
        ("a: 1\n? [b]\n: 1\n", 2, "a key must be a plain text"),
        ("a: 1\nb: [1, 2\nc: 3\n", 3, "is not valid YAML"),
        ("a: 1\nb: '\\\n", 3, "is not valid YAML"),
        ("a: 1\n\tb: 2\n", 2, "is not valid YAML"),
        ("%YAML 9.9\n---\na: 1\n", 1, "is not valid YAML"),
        ("a: 1\nb: \x07\n", 2, "is not allowed"),
        ('a: "\\ud800"\n', 1, "half a character"),
        (b"a: 1\nb: \xff\n", 2, "byte 0xff is not UTF-8"),
        ("a: " + "[" * 40 + "]" * 40, 1, "nested deeper than 30 levels"),
        ("a: " + "[" * 100_000, 1, "nested deeper than 30 levels"),
        (
            "a: &a [[[[[[[[[1]]]]]]]]]\nb: &b [[[[[[[[[*a]]]]]]]]]\nc: [[[[[[[[[[[[*b]]]]]]]]]]]]\n",
            3,
            "nested deeper",
        ),
        ("a: [" + "1," * 20_000 + "]", 1, "more than 20000 values"),
    ],
)
def test_refused_with_its_line(read, text, line, message):
    with pytest.raises(SceneError) as error:
        read(text)
    assert f"scene.yaml:{line}: " in str(error.value)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_aliases_that_multiply_are_refused_before_they_expand(read):
    text = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
    text += "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 25))
    with pytest.raises(SceneError, match=r":5: has more than 20000 values, those behind aliases included"):
        read(text)  # 9^25 values


def test_files_that_are_too_large_or_cannot_be_read(read, folder):
    with pytest.raises(SceneError, match="more than 1000000 bytes"):
        read(b"#" * (MAXIMUM_BYTES + 1))
    with pytest.raises(SceneError, match="cannot be read"):
        read_yaml(folder / "missing.yaml")
    with pytest.raises(SceneError, match="cannot be read"):
        read_yaml(folder)


@given(
    st.binary(max_size=60)
    | st.text("ab:-[]{}&*!|>'\"%@`#,? \n\t~.0é\ud800", max_size=60).map(lambda t: t.encode("utf-8", "surrogatepass"))
)
@example(b"a: !<\n")
@example(b'a: "\\x')
@example(b"? \n")
@example(b"--- |\n")
def test_any_bytes_are_read_or_refused(folder, raw):
    path = folder / "any.yaml"
    path.write_bytes(raw)
    error = None
    try:
        assert isinstance(read_yaml(path).value, dict)
    except SceneError as caught:
        error = str(caught)
    assert error is None or (error.startswith(f"{path}:") and len(error.splitlines()) == 1)
