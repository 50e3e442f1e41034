"""What goes between a kernel and the examiner: plain values arrive as they were, and nothing that arrives is run."""

import io
import json
import pathlib
import pickle

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.sparse import csr_array

from hdr_helpers.lab.checks._wire import HEAD, PICTURES, WireError, pack, unpack

DTYPES = [
    "?",
    "u1",
    "i2",
    "<i4",
    ">i4",
    "i8",
    "u8",
    "f2",
    "f4",
    "f8",
    ">f8",
    "c8",
    "c16",
    "U3",
    "S2",
    "M8[s]",
    "m8[ms]",
]


def an_array(rng):
    dtype = np.dtype(DTYPES[rng.integers(len(DTYPES))])
    shape = tuple(rng.integers(0, 4, rng.integers(0, 4)))
    content = rng.integers(0, 2, int(np.prod(shape)) * dtype.itemsize, dtype=np.uint8)
    array = np.frombuffer(content.tobytes() or b"", dtype).reshape(shape) if content.size else np.zeros(shape, dtype)
    if dtype.kind in "fc" and array.size:
        array = array.copy()
        array.flat[0] = np.nan
    return (array, np.asfortranarray(array), array[::-1] if array.ndim else array)[rng.integers(3)]


def a_leaf(rng):
    leaves = (
        lambda: None,
        lambda: bool(rng.integers(2)),
        lambda: int(rng.integers(-(2**62), 2**62)),
        lambda: float(rng.normal() * 10.0 ** rng.integers(-300, 300)),
        lambda: float(rng.choice([np.nan, np.inf, -np.inf, -0.0])),
        lambda: "".join(map(chr, rng.choice([10, 34, 65, 92, 228, 0x5149, 0x1F4F7], 5))),
        lambda: complex(*rng.normal(size=2)),
        lambda: pathlib.Path("a") / f"{rng.integers(99)}.png",
        lambda: rng.choice([np.float32(1.5), np.uint8(3), np.bool_(True), np.int64(-4)]),
        lambda: an_array(rng),
        lambda: np.ma.masked_array(rng.normal(size=3)),
        lambda: np.asmatrix(rng.normal(size=(2, 2))),
    )
    return leaves[rng.integers(len(leaves))]()


def a_nest(rng, depth=0):
    kind = rng.integers(5) if depth < 4 else 4
    if kind > 2:
        return a_leaf(rng)
    parts = [a_nest(rng, depth + 1) for _ in range(rng.integers(4))]
    if kind == 2:
        keys = ("a", "b.png", 3, 4.5, (1, "c"), None)
        return {keys[k]: part for k, part in zip(rng.permutation(len(keys)), parts, strict=False)}
    return parts if kind else tuple(parts)


def alike(these, those):
    if type(these) is not type(those):
        return False
    if isinstance(these, (np.ndarray, np.generic)):
        same_form = these.dtype == those.dtype and these.shape == those.shape
        return same_form and np.asarray(these).tobytes() == np.asarray(those).tobytes()
    if isinstance(these, dict):
        return list(these) == list(those) and all(alike(these[key], those[key]) for key in these)
    if isinstance(these, (list, tuple)):
        return len(these) == len(those) and all(map(alike, these, those))
    return repr(these) == repr(those)


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of matrices
@pytest.mark.parametrize("block", range(6))
def test_plain_values_arrive_as_they_were(block):
    for seed in range(50):
        nest = a_nest(np.random.default_rng((7, block, seed)))
        assert alike(nest, unpack(pack(nest))), (block, seed)
    assert not alike([np.zeros(2)], [np.zeros(2, np.float32)]) and not alike((1,), [1])


def test_what_arrives_can_be_written_to_and_shares_nothing():
    array = np.zeros((2, 3), order="F")
    arrived = unpack(pack([array, array]))
    arrived[0][...] = 1
    assert not array.any() and not arrived[1].any()


def test_a_sparse_matrix_arrives_as_one():
    matrix = csr_array(np.random.default_rng(0).integers(0, 2, (5, 7)).astype(float))
    arrived = unpack(pack((matrix,)))[0]
    assert arrived.shape == (5, 7) and np.array_equal(arrived.toarray(), matrix.toarray())


class Gramophone:
    pass


def test_what_has_no_plain_form_arrives_with_the_name_of_its_type():
    odd = [Gramophone(), {1, 2}, b"bytes", lambda: 0, (x for x in ()), 2**70, Gramophone]
    arrived = unpack(pack(odd))
    assert [type(value).__name__ for value in arrived] == [type(value).__name__ for value in odd]
    assert not isinstance(arrived[0], Gramophone) and not vars(arrived[0])
    objects = unpack(pack(np.array([[Gramophone(), "a"]], dtype=object)))
    assert objects.dtype == object and objects.shape == (1, 2) and objects[0, 0] is None


def test_a_nest_without_an_end_arrives_cut_off(monkeypatch):
    ring = []
    ring += [ring]
    arrived = unpack(pack(ring))
    for _ in range(21):
        arrived = arrived[0]
    assert type(arrived).__name__ == "nest"
    monkeypatch.setattr("hdr_helpers.lab.checks._wire.NODES", 1000)
    assert [type(part).__name__ for part in unpack(pack([0] * 1001))[-3:]] == ["int", "nest", "nest"]


def test_a_figure_arrives_with_what_a_check_looks_at():
    figure = Figure()
    for k, scale in enumerate(("log", "linear")):
        ax = figure.add_subplot(1, 2, k + 1)
        ax.plot([1, 2, 3], [4, 5, 6 + k], color=("#D55E00", "green")[k], label="red")
        ax.set(xlabel=f"x{k}", ylabel="y $z$", yscale=scale, title="t" * k)
        ax.text(1, 4, "word")
    ax.legend()
    figure.supylabel("exposure")
    arrived = unpack(pack(figure))
    assert type(arrived) is Figure and arrived.get_supylabel() == "exposure" and not arrived.get_supxlabel()
    for one, other in zip(figure.axes, arrived.axes, strict=True):
        for name in ("xlabel", "ylabel", "xscale", "yscale", "title"):
            assert getattr(one, f"get_{name}")() == getattr(other, f"get_{name}")()
        assert len(other.texts) == 1 and (one.get_legend() is None) == (other.get_legend() is None)
        assert np.array_equal(one.lines[0].get_xydata(), other.lines[0].get_xydata())
    colours = [ax.lines[0].get_color() for ax in arrived.axes]
    assert colours[0] == pytest.approx((0xD5 / 255, 0x5E / 255, 0, 1)) and colours[1][1] > 0.4


class Harm:
    """Makes a file where it is unpickled."""

    def __init__(self, place):
        self.place = place

    def __reduce__(self):
        return (pathlib.Path.touch, (self.place,))


def message(tree, *blobs):
    head = json.dumps({"tree": tree, "sizes": [len(blob) for blob in blobs]}).encode()
    return b"".join([head, b"\n", *blobs])


def npy(header, content=b""):
    text = header.ljust(117).encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + content


def test_nothing_that_arrives_is_run(tmp_path):
    harm = Harm(tmp_path / "harm")
    pickled, archive = io.BytesIO(), io.BytesIO()
    np.save(pickled, np.array([harm], dtype=object), allow_pickle=True)
    np.savez(archive, a=np.array([harm], dtype=object))
    blobs = [pickle.dumps(harm), pickled.getvalue(), archive.getvalue(), npy("__import__('os').abort()")]
    for data in [pickle.dumps(harm), *(message([kind, 0], blob) for kind in ("ndarray", "scalar") for blob in blobs)]:
        with pytest.raises(WireError):
            unpack(data)
    assert not harm.place.exists()
    pickle.loads(blobs[0])
    assert harm.place.exists()


SHAPE = "{{'descr': {!r}, 'fortran_order': False, 'shape': {}, }}"
HUGE = {
    "no bytes": b"",
    "no line": b"{" * 100,
    "a head without an end": b" " * (HEAD + 1),
    "a deep nest": b"[" * 10_000 + b"]" * 10_000 + b"\n",
    "a deep tree": message(json.loads('["list", [' * 400 + '["value", 1]' + "]]" * 400)),
    "a nest in place of a value": message(["value", [[[1]]]]),
    "no such kind": message(["module", "os"]),
    "no such array": message(["ndarray", 3]),
    "no such name": message(["odd", "a\0b"]),
    "an array larger than its bytes": message(["ndarray", 0], npy(SHAPE.format("<f8", (10**9,)), bytes(8))),
    "an array smaller than its bytes": message(["ndarray", 0], npy(SHAPE.format("<f8", (1,)), bytes(16))),
    "an array of endless nothing": message(["ndarray", 0], npy(SHAPE.format("|V0", (10**15,)))),
    "a negative shape": message(["ndarray", 0], npy(SHAPE.format("<f8", (-1, -1)), bytes(8))),
    "an array of objects": message(["ndarray", 0], npy(SHAPE.format("|O", (1,)), bytes(8))),
    "a header that is a deep nest": message(["ndarray", 0], npy("-" * 9000 + "1")),
    "described objects": message(["objects", [10**6, 10**6]]),
    "described objects of a negative length": message(["objects", [-1]]),
    "a sparse matrix to be written out": message(
        ["sparse", [["ndarray", 0], ["ndarray", 1], ["ndarray", 1], ["tuple", [["value", 10**6], ["value", 10**6]]]]],
        npy(SHAPE.format("<f8", (1,)), bytes(8)),
        npy(SHAPE.format("<i8", (1,)), bytes(8)),
    ),
    "many pictures": message(["list", [["axes", None]] * (PICTURES + 1)]),
}


@pytest.mark.parametrize("what", HUGE)
def test_what_is_no_message_is_refused(what):
    with pytest.raises(WireError):
        unpack(HUGE[what])


def test_every_beginning_of_a_message_is_refused():
    whole = pack({"value": ([np.arange(5.0), "word"], np.float32(2), {"a": 1})})
    for length in range(len(whole)):
        with pytest.raises(WireError):
            unpack(whole[:length])


def test_random_bytes_and_spoilt_messages_are_refused_or_plain():
    rng = np.random.default_rng(3)
    figure = Figure()
    figure.add_subplot().plot([1, 2])
    whole = pack({"value": [a_nest(rng) for _ in range(4)]}), pack(figure), pack(csr_array(np.eye(3)))
    refused = 0
    for k in range(1500):
        if k < 500:
            data = rng.bytes(rng.integers(1, 300))
        else:
            data = bytearray(whole[k % 3])
            for place in rng.integers(0, len(data), rng.integers(1, 4)):
                data[place] = rng.integers(256)
        try:
            unpack(bytes(data))
        except WireError:
            refused += 1
    assert 500 <= refused < 1500
