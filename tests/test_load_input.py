"""Any bracket a student brings is loaded, or refused in one sentence that says why not."""

import io
import random
import re
import struct
import subprocess
import sys
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps
from PIL.TiffImagePlugin import IFDRational

from hdr_helpers._reading.pictures import Photograph, decode, read_exif
from hdr_helpers.load import BracketError, load_bracket

NAMES = ("a_1.png", "a_2.png", "a_3.png")
TIMES = (1 / 60, 1 / 30, 1 / 15)
LISTED = "a_1.png 1/60\na_2.png 1/30\na_3.png 1/15\n"
FORMATS = {".jpg": "JPEG", ".png": "PNG", ".tif": "TIFF", ".bmp": "BMP", ".ppm": "PPM"}


def scene(width=48, height=32):
    """Three exposures of a smooth scene, uint8 RGB, one stop apart, shortest first."""
    light = cv2.resize(np.random.default_rng(7).random((8, 12, 3)), (width, height), interpolation=cv2.INTER_LINEAR)
    return tuple(np.uint8(255 * (0.05 + 0.95 * light) ** 0.45 * 2 ** (-0.45 * stops)) for stops in (2, 1, 0))


SCENE = scene()


def in_pillow(picture, kind, **options):
    """A picture, array or PIL image, as the bytes of a file of some kind, such as ".jpg"."""
    file = io.BytesIO()
    picture = Image.fromarray(picture) if isinstance(picture, np.ndarray) else picture
    picture.save(file, FORMATS[kind], **({"quality": 95} if kind == ".jpg" else {}), **options)
    return file.getvalue()


def in_opencv(picture, kind):
    """The same with OpenCV, which writes 16 bits too; grey, RGB or RGBA."""
    if picture.ndim == 3:
        picture = np.ascontiguousarray(picture[..., [2, 1, 0, 3][: picture.shape[2]]])
    return cv2.imencode(kind, picture)[1].tobytes()


def netpbm(picture, top, head="P6\n{} {}\n{}\n"):
    """A PPM file by hand, whatever its largest value."""
    kind = ">u2" if top > 255 else "u1"
    return head.format(picture.shape[1], picture.shape[0], top).encode() + picture.astype(kind).tobytes()


def bracket_of(kind, **options):
    """Files of a whole bracket of one kind, with a list of its times that names no photograph."""
    return {f"a_{i}{kind}": in_pillow(image, kind, **options) for i, image in enumerate(SCENE, 1)} | {
        "t.txt": b"1/60 1/30 1/15"
    }


GOOD = {name: in_pillow(image, ".png") for name, image in zip(NAMES, SCENE, strict=True)} | {"t.txt": LISTED.encode()}


def lay(folder, files):
    """Write files into a folder: bytes or text, None for none, a dict for a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        if isinstance(content, dict):
            lay(folder / name, content)
        elif content is not None:
            (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


def packed(files, compression=zipfile.ZIP_DEFLATED):
    """The bytes of a zip."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return file.getvalue()


def patched(data, mark, offset, layout, value, last=None):
    """The same bytes with a field overwritten in the records that begin with a mark: all, or as many as last."""
    data = bytearray(data)
    for found in list(re.finditer(re.escape(mark), bytes(data)))[:last]:
        struct.pack_into(layout, data, found.start() + offset, value)
    return bytes(data)


LOCAL, CENTRAL, END = b"PK\3\4", b"PK\1\2", b"PK\5\6"  # records of a zip


def contents(folder):
    """Every path below a folder, with its bytes."""
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


# --------------------------------------------------------------------------------------- refused
# Each case: what to lay into a folder, words that the message must hold, what to replace meanwhile. Cases of
# files only are one folder, "set"; otherwise a function lays out what it needs and returns what to load.


def with_files(**files):
    """The good bracket with some files changed; a_2 stands for a_2.png and t for t.txt."""
    return lambda at: lay(at / "set", GOOD | {{"t": "t.txt"}.get(k, f"{k}.png"): v for k, v in files.items()})


def only(files):
    return lambda at: lay(at / "set", files)


def a_zip(data):
    return lambda at: lay(at, {"set.zip": data}) / "set.zip"


def spoiled(kind, end):
    """A bracket of one kind with its second photograph cut short; end maps its length to what is left."""
    files = bracket_of(kind)
    data = files[f"a_2{kind}"]
    return only(files | {f"a_2{kind}": data[: end(len(data))]})


def no_memory(*_):
    raise MemoryError


def no_memory_in_opencv(*_):
    problem = cv2.error("alloc.cpp:73: error: (-4:Insufficient memory) Failed to allocate 144000000 bytes")
    problem.code = cv2.Error.StsNoMem
    raise problem


def ten_bits(head="P6\n{} {}\n{}\n"):
    """A whole bracket of 10 bits, whose values OpenCV would take for very dark ones of 16."""
    return {f"a_{i}.ppm": netpbm(im.astype(np.uint16) * 4, 1023, head) for i, im in enumerate(SCENE, 1)} | {
        "t.txt": "1/60 1/30 1/15"
    }


DEEP = SCENE[1].astype(np.uint16) * 257
CUTS = {
    "half": lambda n: n // 2,
    "nine tenths": lambda n: n * 9 // 10,
    "all but two bytes": lambda n: n - 2,
    "its header": lambda n: 20,
}
HALF_ZEROS = bracket_of(".jpg")["a_2.jpg"]
HALF_ZEROS = HALF_ZEROS[: len(HALF_ZEROS) // 2].ljust(len(HALF_ZEROS), b"\0")
ZIPPED = packed(GOOD)
LZMA = packed(GOOD, zipfile.ZIP_LZMA)
CHINESE = packed({name.replace("a", "照片"): data for name, data in GOOD.items()})

NO_TIMES = {
    "zero": "0",
    "a negative time": "-1/30",
    "nan": "nan",
    "infinity": "inf",
    "1/0": "1/0",
    "a number beyond all floats": "1e999",
    "a word": "short",
}
REFUSED = {
    # the folder
    "a folder that does not exist": (lambda at: at / "nowhere", ["nowhere", "does not exist"]),
    "a path longer than any": (lambda at: at / ("long" * 100), ["long"]),
    "an empty folder": (only({}), ["set", "0 photographs", "at least two"]),
    "one photograph only": (only({"a_1.png": GOOD["a_1.png"], "t.txt": "1/60"}), ["1 photograph;", "at least two"]),
    "folders named like photographs": (only({"a_1.jpg": {}, "a_2.jpg": {}}), ["0 photographs", "at least two"]),
    "raw files only": (only({"a_1.cr2": b"raw", "a_2.heic": b"heic"}), ["0 photographs", "HEIC", "JPEG"]),
    "two folders side by side": (only({"monday": GOOD, "tuesday": GOOD}), ["monday", "tuesday", "one folder"]),
    # the zip
    "an empty zip": (a_zip(packed({})), ["set.zip", "0 photographs"]),
    "a file that is no zip": (a_zip(b"not a zip"), ["set.zip", "cut short, or no zip"]),
    "an empty file as zip": (a_zip(b""), ["set.zip", "cut short, or no zip"]),
    "a photograph as zip": (a_zip(GOOD["a_1.png"]), ["set.zip", "cut short, or no zip"]),
    "a zip cut in half": (a_zip(ZIPPED[: len(ZIPPED) // 2]), ["set.zip"]),
    "a zip with a password": (a_zip(patched(patched(ZIPPED, CENTRAL, 8, "<H", 1), LOCAL, 6, "<H", 1)), ["password"]),
    "a zip with a damaged photograph": (a_zip(patched(ZIPPED, LOCAL, 60, "<I", 0xDEADBEEF, 1)), ["a_1.png", "set.zip"]),
    "a zip with a damaged photograph, packed as LZMA": (
        a_zip(patched(LZMA, LOCAL, 60, "<I", 0xDEADBEEF, 1)),
        ["a_1.png"],
    ),
    "a zip with a damaged directory": (a_zip(patched(ZIPPED, CENTRAL, 0, "<I", 0)), ["set.zip"]),
    "a zip with its directory elsewhere": (a_zip(patched(ZIPPED, END, 16, "<I", 0xFFFFFF)), ["set.zip"]),
    "a zip of a later kind": (a_zip(patched(ZIPPED, CENTRAL, 6, "<H", 143)), ["set.zip"]),
    "a zip packed in an unknown way": (a_zip(patched(ZIPPED, CENTRAL, 10, "<H", 99)), ["set.zip"]),
    "a zip with names that are not what they are marked as": (
        a_zip(patched(CHINESE, CENTRAL, 46, "B", 255)),
        ["set.zip"],
    ),
    "a zip with other names in front than in its directory": (a_zip(patched(ZIPPED, LOCAL, 30, "B", 65)), ["set.zip"]),
    "a zip that says it unpacks to 16 GB": (
        a_zip(patched(ZIPPED, CENTRAL, 24, "<I", 0xFFFFFFF0)),
        ["set.zip", "16.0 GB"],
    ),
    "a zip of 64 MB of zeros": (
        a_zip(packed(GOOD | {"a_4.png": bytes(64 * 2**20)})),
        ["set.zip", "unpacks to"],
        {"hdr_helpers._reading.files.MAX_BYTES": 2**20},
    ),
    "a zip file that is too large itself": (
        a_zip(packed(GOOD)),
        ["set.zip", "GB"],
        {"hdr_helpers._reading.files.MAX_BYTES": len(ZIPPED) - 1},
    ),
    "a zip that lies about its size": (a_zip(patched(ZIPPED, CENTRAL, 24, "<I", 5, 1)), ["a_1.png", "set.zip"]),
    # photographs that do not fit each other
    "different sizes": (with_files(a_2=in_pillow(SCENE[1][:-1, :-2], ".png")), ["a_2.png", "46 x 31", "48 x 32"]),
    "a photograph on its side": (with_files(a_2=in_pillow(np.rot90(SCENE[1]), ".png")), ["a_2.png", "32 x 48"]),
    "8 bits beside 16": (with_files(a_2=in_opencv(DEEP, ".png")), ["a_2.png", "16 bits", "8 bits"]),
    # photographs that can't be read
    **{
        f"{kind[1:].upper()} of which {what} is left": (spoiled(kind, end), [f"a_2{kind}", "cut short"])
        for kind in FORMATS
        for what, end in CUTS.items()
    },
    "JPEG whose second half is zeros": (only(bracket_of(".jpg") | {"a_2.jpg": HALF_ZEROS}), ["a_2.jpg", "cut short"]),
    "an empty photograph": (with_files(a_3=b""), ["a_3.png", "can't be read"]),
    "a text file called JPEG": (only(bracket_of(".jpg") | {"a_2.jpg": "my notes"}), ["a_2.jpg", "can't be read"]),
    "a HEIC file called JPEG": (
        only(bracket_of(".jpg") | {"a_2.jpg": b"\0\0\0\x18ftypheic" + bytes(range(256)) * 8}),
        ["a_2.jpg", "can't be read", "save it as JPEG"],
    ),
    "TIFF of floats": (
        only(bracket_of(".tif") | {"a_2.tif": in_opencv(SCENE[1].astype(np.float32) / 255, ".tif")}),
        ["a_2.tif", "float32", "8 or 16 bits"],
    ),
    "PPM up to 1023": (only(ten_bits()), ["a_1.ppm", "1023", "65535"]),
    **{
        f"PPM up to 1023 with a comment {where}": (
            only(ten_bits(head)),
            ["a_1.ppm", "1023", "65535"],
        )
        for where, head in {
            "on its own line": "P6\n# a camera\n{} {}\n{}\n",
            "after its mark": "P6 # a camera\n{} {}\n{}\n",
            "between its sizes": "P6\n{} # wide\n{}\n{}\n",
            "after its sizes": "P6\n{} {}\n# a camera\n{}\n",
        }.items()
    },
    "plain PPM up to 1023": (
        only(
            {f"a_{v}.ppm": "P3\n48 32\n1023\n" + f"{300 * v} 90 {200 * v} " * 48 * 32 for v in (1, 2, 3)}
            | {"t.txt": "1 2 3"}
        ),
        ["a_1.ppm", "1023", "65535"],
    ),
    "more pixels than are read": (
        with_files(),
        ["a_1.png", "million pixels"],
        {"hdr_helpers._reading.pictures.MAX_PIXELS": 48 * 32 - 1},
    ),
    "more than fits into memory": (with_files(), ["set", "memory"], {"hdr_helpers.load.decode": no_memory}),
    "more than OpenCV finds memory for": (
        with_files(),
        ["set", "memory"],
        {"hdr_helpers._reading.pictures.cv2.imdecodeWithMetadata": no_memory_in_opencv},
    ),
    # times
    "a photograph of the list that is missing": (with_files(a_2=None), ["t.txt", "a_2.png", "not among"]),
    "a photograph that is not in the list": (
        with_files(t=LISTED.replace("a_2.png 1/30\n", "")),
        ["t.txt", "a_2.png", "1/60"],
    ),
    "a photograph listed with two times": (with_files(t=LISTED + "a_2.png 1/8"), ["t.txt", "a_2.png", "twice"]),
    **{
        f"{what} in a list of names": (with_files(t=LISTED.replace("1/30", value)), ["t.txt", "a_2.png", "1/60"])
        for what, value in NO_TIMES.items()
    },
    **{
        f"{what} in a list without names": (with_files(t=f"1/60 {value} 1/15"), ["t.txt", "a_", "1/60"])
        for what, value in NO_TIMES.items()
    },
    "words instead of all times": (with_files(t=re.sub("1/..", "bright", LISTED)), ["t.txt", "1/60"]),
    "equal times": (with_files(t="1/60 1/30 1/30"), ["a_2.png", "a_3.png", "same exposure time", "0.03333 s"]),
    "shuffled times": (with_files(t="1/15 1/60 1/30"), ["t.txt", "do not get brighter"]),
    "one time too few": (with_files(t="1/60 1/30"), ["t.txt", "3 photographs", "a_1.png, a_2.png"]),
    "one time too many": (with_files(t="1/60 1/30 1/15 1/8"), ["t.txt", "3 photographs", "a_1.png, a_2.png"]),
    "no times at all": (with_files(t=None), ["No exposure times", "set", "a_1.png 1/60"]),
    "an empty list": (with_files(t=""), ["No exposure times", "t.txt", "a_1.png 1/60"]),
    "a list of unreadable bytes": (with_files(t=random.Random(5).randbytes(4000)), ["t.txt", "a_1.png 1/60"]),
    "no times in forty notes": (
        only(GOOD | {"t.txt": None} | {f"my note number {i}.txt": "fine weather" for i in range(40)}),
        ["No exposure times", "my note number", "a_1.png 1/60"],
    ),
    **{
        f"file names with EV {stops}": (
            only({f"a_EV{ev}.png": GOOD[n] for n, ev in zip(NAMES, values, strict=True)}),
            ["a_EV"],
        )
        for stops, values in {5000: (0, 1, 5000), -5000: (-5000, 0, 1)}.items()
    },
}


def refusal(case, tmp_path, monkeypatch):
    """The error that a case of the table above ends in; nothing is written meanwhile."""
    make, _, *patches = REFUSED[case]
    path = make(tmp_path)
    monkeypatch.chdir(tmp_path)
    for target, value in patches[0].items() if patches else ():
        monkeypatch.setattr(target, value)
    before = contents(tmp_path)
    with pytest.raises(BracketError) as problem:
        load_bracket(path)
    assert contents(tmp_path) == before
    return problem.value


@pytest.mark.parametrize("case", REFUSED)
def test_what_can_not_be_used_is_refused_by_name(case, tmp_path, monkeypatch):
    message = str(refusal(case, tmp_path, monkeypatch))
    for word in REFUSED[case][1]:
        assert word in message


@pytest.mark.parametrize("case", REFUSED)
def test_a_refusal_is_one_sentence_for_people(case, tmp_path, monkeypatch):
    problem = refusal(case, tmp_path, monkeypatch)
    assert type(problem) is BracketError
    message = re.sub(rf"{re.escape(str(tmp_path))}\S*?/?(?=set|nowhere|long)(?:long)*", "", str(problem))
    assert "\n" not in message
    assert len(message) <= 300
    assert re.search(r"(\.|as in: \S+ 1/60)$", message)
    assert not re.search(r"[<>{}\[\]]|Error|Exception|Traceback", message)  # nothing that only programs say


def test_a_zip_that_lies_about_its_size_is_not_unpacked_beyond_it(tmp_path):
    zeros = packed({"a_1.png": bytes(64 * 2**20), "a_2.png": GOOD["a_2.png"], "t.txt": "1/60 1/30"})
    path = a_zip(patched(zeros, CENTRAL, 24, "<I", 1000, 1))(tmp_path)
    tracemalloc.start()
    try:
        with pytest.raises(BracketError, match=r"a_1\.png"):
            load_bracket(path)
        assert tracemalloc.get_traced_memory()[1] < 8 * 2**20
    finally:
        tracemalloc.stop()


def test_a_picture_with_too_many_pixels_is_refused_before_it_takes_memory(tmp_path):
    pytest.importorskip("resource", reason="memory is measured as Unix does")

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    side = 14_400  # one bit each: 26 KB that unpack to 622 MB
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0))
    rows = chunk(b"IDAT", zlib.compress(bytes(side * (side // 8 + 1))))
    (tmp_path / "huge.png").write_bytes(b"\x89PNG\r\n\x1a\n" + header + rows + chunk(b"IEND", b""))
    program = """if True:
        import pathlib, resource, sys
        from hdr_helpers._reading.pictures import BracketError, decode
        unit = 1 if sys.platform == "darwin" else 1024
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        try:
            decode("huge.png", pathlib.Path("huge.png").read_bytes())
        except BracketError as problem:
            print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * unit // 2**20, problem)
    """
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
    megabytes, message = done.stdout.split(" ", 1)
    assert "huge.png" in message and "million pixels" in message
    assert int(megabytes) < 100


# ---------------------------------------------------------------------------------------- loaded


def load(tmp_path, files):
    """Load a folder of these files; loading must not change it."""
    folder = lay(tmp_path / "set", files)
    before = contents(tmp_path)
    bracket = load_bracket(folder)
    assert contents(tmp_path) == before
    return bracket


def as_pillow_sees(data):
    return np.asarray(ImageOps.exif_transpose(Image.open(io.BytesIO(data))).convert("RGB"))


@pytest.mark.parametrize("kind", FORMATS)
def test_grey_photographs_become_rgb_with_three_equal_channels(tmp_path, kind):
    files = {f"a_{i}{kind}": in_pillow(image[..., 1], kind) for i, image in enumerate(SCENE, 1)}
    bracket = load(tmp_path, files | {"t.txt": "1/60 1/30 1/15"})
    for image, data in zip(bracket.images, files.values(), strict=True):
        assert image.shape == (32, 48, 3) and image.dtype == np.uint8
        assert np.array_equal(image, np.repeat(image[..., :1], 3, axis=2))
        assert np.array_equal(image, as_pillow_sees(data))


def test_a_grey_ppm_is_the_p5_that_some_programs_write(tmp_path):
    files = {f"a_{i}.ppm": netpbm(image[..., 1], 255, "P5\n{} {}\n{}\n") for i, image in enumerate(SCENE, 1)}
    for image, given in zip(load(tmp_path, files | {"t.txt": "1 2 4"}).images, SCENE, strict=True):
        assert np.array_equal(image, np.dstack([given[..., 1]] * 3))


@pytest.mark.parametrize("kind", [".png", ".tif", ".bmp", ".ppm"])
def test_photographs_without_loss_come_as_they_are(tmp_path, kind):
    bracket = load(tmp_path, bracket_of(kind))
    assert bracket.valid is None
    assert all(np.array_equal(a, b) and a.dtype == np.uint8 for a, b in zip(bracket.images, SCENE, strict=True))


@pytest.mark.parametrize("options", [{}, {"progressive": True}, {"subsampling": 0}], ids=["", "progressive", "4:4:4"])
def test_jpeg_comes_as_other_programs_show_it(tmp_path, options):
    files = bracket_of(".jpg", **options)
    for image, data in zip(load(tmp_path, files).images, files.values(), strict=False):
        assert np.abs(image.astype(int) - as_pillow_sees(data)).max() <= 2


@pytest.mark.parametrize("tail", [b"\0" * 999, b"SEFH" * 300, HALF_ZEROS], ids=["zeros", "notes", "a second picture"])
def test_what_phones_write_behind_a_jpeg_does_no_harm(tmp_path, tail):
    files = bracket_of(".jpg")
    bracket = load(tmp_path, files | {"a_2.jpg": files["a_2.jpg"] + tail})
    assert np.abs(bracket.images[1].astype(int) - as_pillow_sees(files["a_2.jpg"])).max() <= 2


@pytest.mark.parametrize("compression", ["tiff_lzw", "tiff_deflate", "packbits"])
def test_packed_tiff_comes_as_it_is(tmp_path, compression):
    bracket = load(tmp_path, bracket_of(".tif", compression=compression))
    assert all(np.array_equal(a, b) for a, b in zip(bracket.images, SCENE, strict=True))


@pytest.mark.parametrize("kind", [".png", ".tif", ".ppm"])
@pytest.mark.parametrize("grey", [False, True], ids=["colour", "grey"])
def test_16_bits_stay_16_bits(tmp_path, kind, grey):
    deep = [image.astype(np.uint16) * 256 + 77 for image in SCENE]
    if kind == ".ppm":
        files = [netpbm(d[..., 1], 65535, "P5\n{} {}\n{}\n") if grey else netpbm(d, 65535) for d in deep]
    else:
        files = [in_opencv(d[..., 1] if grey else d, kind) for d in deep]
    files = {f"a_{i}{kind}": data for i, data in enumerate(files, 1)}
    for image, given in zip(load(tmp_path, files | {"t.txt": "1 2 4"}).images, deep, strict=True):
        assert image.dtype == np.uint16
        assert np.array_equal(image, np.dstack([given[..., 1]] * 3) if grey else given)


def with_alpha(image, alpha):
    return np.dstack([image, np.broadcast_to(alpha, image.shape[:2]).astype(image.dtype)])


@pytest.mark.parametrize("kind", [".png", ".tif"])
def test_an_opaque_alpha_channel_is_dropped(tmp_path, kind):
    files = {f"a_{i}{kind}": in_pillow(with_alpha(image, 255), kind) for i, image in enumerate(SCENE, 1)}
    bracket = load(tmp_path, files | {"t.txt": "1/60 1/30 1/15"})
    assert bracket.valid is None
    assert all(np.array_equal(a, b) for a, b in zip(bracket.images, SCENE, strict=True))


SOLID = np.ones((32, 48), dtype=bool)
SOLID[:, :5] = SOLID[-3:] = False


def hidden_border(kind, bits, **options):
    """A bracket in which an alignment left a transparent border at the second photograph alone."""
    top, files = 2**bits - 1, {}
    for i, image in enumerate(SCENE, 1):
        picture = with_alpha(image if bits == 8 else image.astype(np.uint16) * 257, SOLID * top if i == 2 else top)
        data = in_pillow(picture, kind, **options) if bits == 8 else in_opencv(picture, kind)
        files[f"a_{i}{kind}"] = data
    return files | {"t.txt": "1/60 1/30 1/15"}


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("kind", [".png", ".tif"])
def test_a_transparent_border_is_no_photograph(tmp_path, kind, bits):
    bracket = load(tmp_path, hidden_border(kind, bits))
    assert bracket.valid[0].all() and bracket.valid[2].all()
    assert np.array_equal(bracket.valid[1], SOLID)
    assert bracket.images[1].shape == (32, 48, 3)
    assert any(note.startswith("a_2") and "transparent" in note for note in bracket.notes)


@pytest.mark.parametrize("kind", [".png", ".tif"])
@pytest.mark.parametrize("orientation", [0, 1, 2, 3, 4, 5, 6, 7, 8, 9])
def test_a_transparent_border_is_turned_with_its_photograph(tmp_path, orientation, kind):
    exif = Image.Exif()
    exif[0x0112] = orientation
    files = hidden_border(kind, 8, **({"exif": exif} if kind == ".png" else {"tiffinfo": {0x0112: orientation}}))
    bracket = load(tmp_path, files)
    upright = np.asarray(ImageOps.exif_transpose(Image.open(io.BytesIO(files[f"a_2{kind}"]))))
    assert bracket.valid is not None
    assert np.array_equal(bracket.valid[1], upright[..., 3] > 0)
    assert np.array_equal(bracket.images[1][bracket.valid[1]], upright[bracket.valid[1], :3])


def test_cmyk_becomes_rgb(tmp_path):
    files = {f"a_{i}.jpg": in_pillow(Image.fromarray(im).convert("CMYK"), ".jpg") for i, im in enumerate(SCENE, 1)}
    for image, given in zip(load(tmp_path, files | {"t.txt": "1 2 4"}).images, SCENE, strict=True):
        assert np.abs(image.astype(int) - given).mean() < 3


def test_a_palette_becomes_rgb(tmp_path):
    files = {f"a_{i}.png": in_pillow(Image.fromarray(image).quantize(64), ".png") for i, image in enumerate(SCENE, 1)}
    for image, data in zip(load(tmp_path, files | {"t.txt": "1 2 4"}).images, files.values(), strict=True):
        assert np.array_equal(image, as_pillow_sees(data))


@pytest.mark.parametrize("orientation", range(10))
@pytest.mark.parametrize("kind", [".jpg", ".png", ".tif"])
def test_photographs_stand_upright_as_their_exif_says(tmp_path, kind, orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation  # 0 and 9 mean nothing
    files = bracket_of(kind, exif=exif)
    for image, data in zip(load(tmp_path, files).images, files.values(), strict=False):
        expected = as_pillow_sees(data)
        assert image.shape == expected.shape == ((48, 32, 3) if 5 <= orientation <= 8 else (32, 48, 3))
        assert np.abs(image.astype(int) - expected).max() <= 2


def test_suffixes_may_be_in_capitals_and_kinds_mixed(tmp_path):
    files = {
        "A_1.PNG": in_pillow(SCENE[0], ".png"),
        "A_2.TIF": in_pillow(SCENE[1], ".tif"),
        "A_3.BMP": in_pillow(SCENE[2], ".bmp"),
        "T.TXT": "1/60 1/30 1/15",
    }
    bracket = load(tmp_path, files)
    assert bracket.names == ("A_1.PNG", "A_2.TIF", "A_3.BMP")
    assert all(np.array_equal(a, b) for a, b in zip(bracket.images, SCENE, strict=True))


CHINESE_LIST = "# 我的照片\n照片2.png 1/30\n照片3.png 1/15\n照片1.png 1/60\n"
WRITTEN = {
    "UTF-8": CHINESE_LIST.encode(),
    "UTF-8 with a mark": CHINESE_LIST.encode("utf-8-sig"),
    "UTF-16, little end first": b"\xff\xfe" + CHINESE_LIST.encode("utf-16-le"),
    "UTF-16, big end first": b"\xfe\xff" + CHINESE_LIST.encode("utf-16-be"),
    "GB18030": CHINESE_LIST.encode("gb18030"),
}


@pytest.mark.parametrize("data", WRITTEN.values(), ids=WRITTEN.keys())
@pytest.mark.parametrize("ends", ["\n", "\r\n"], ids=["LF", "CRLF"])
def test_a_list_may_be_in_any_usual_encoding(tmp_path, data, ends):
    for encoding in ("utf-16-le", "utf-16-be"):
        if CHINESE_LIST.encode(encoding) in data:
            data = data.replace("\n".encode(encoding), ends.encode(encoding))
            break
    else:
        data = data.replace(b"\n", ends.encode())
    names = [f"照片{i}.png" for i in (1, 2, 3)]
    bracket = load(tmp_path, {n: GOOD[g] for n, g in zip(names, NAMES, strict=True)} | {"清单.txt": data})
    assert bracket.names == tuple(names)
    np.testing.assert_allclose(bracket.times, TIMES)


@pytest.mark.parametrize("odd", [b"caf\xe9", b"\xff\x81\x30", b"\xc3", bytes(range(128, 256))], ids=repr)
def test_odd_bytes_in_a_comment_do_no_harm(tmp_path, odd):
    bracket = load(tmp_path, GOOD | {"t.txt": b"# " + odd + b"\r\n" + LISTED.encode()})
    np.testing.assert_allclose(bracket.times, TIMES)


def test_photographs_in_any_order_come_ascending(tmp_path):
    files = {"z.png": GOOD["a_1.png"], "m.png": GOOD["a_3.png"], "b.png": GOOD["a_2.png"]}
    bracket = load(tmp_path, files | {"t.txt": "m.png 1/15\nz.png 1/60\nb.png 1/30"})
    assert bracket.names == ("z.png", "b.png", "m.png")
    np.testing.assert_allclose(bracket.times, TIMES)
    assert all(np.array_equal(a, b) for a, b in zip(bracket.images, SCENE, strict=True))


def test_a_folder_named_like_a_photograph_is_not_looked_at(tmp_path):
    bracket = load(tmp_path, GOOD | {"x.jpg": {}, "y.png": {"inside.png": GOOD["a_1.png"]}, "u.txt": {}})
    assert bracket.names == NAMES


JUNK = {
    ".DS_Store": b"\0\0\0\1Bud1",
    "Thumbs.db": b"\xd0\xcf\x11\xe0",
    "desktop.ini": "[.ShellClassInfo]\r\nIconIndex=7\r\n",
    "._a_1.png": b"\0\5\x16\7",
    "a_1.cr2": b"raw",
    "clip.mp4": b"film",
}


@pytest.mark.parametrize("place", ["folder", "zip"])
def test_what_systems_leave_behind_is_not_looked_at(tmp_path, place):
    apple = {"._a_1.png": b"\0\5\x16\7", "._a_2.png": b"\0\5\x16\7"}
    if place == "folder":
        bracket = load(tmp_path, GOOD | JUNK | {"__MACOSX": apple})
    else:
        bracket = load_bracket(a_zip(packed(JUNK | GOOD | {f"__MACOSX/{n}": d for n, d in apple.items()}))(tmp_path))
    assert bracket.names == NAMES
    np.testing.assert_allclose(bracket.times, TIMES)


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
@pytest.mark.parametrize("inside", ["", "set/", "my photos/set/", "my photos\\set\\"], ids=repr)
def test_a_folder_inside_a_folder_inside_a_zip_is_found(tmp_path, inside, compression):
    bracket = load_bracket(a_zip(packed({inside + n: d for n, d in GOOD.items()}, compression))(tmp_path))
    assert bracket.names == NAMES
    assert all(np.array_equal(a, b) for a, b in zip(bracket.images, SCENE, strict=True))


def test_a_folder_inside_a_folder_is_found(tmp_path):
    assert load(tmp_path, {"my photos": {"set": GOOD}, "read me.txt": "1 2 3"}).names == NAMES


def test_a_zip_from_chinese_windows_gives_names_that_match_its_list(tmp_path):
    gb = "照片".encode("gb18030")
    names = [f"PICS{i}.png" for i in (1, 2, 3)]  # as long in bytes, and exchanged in the zip
    files = {n: GOOD[g] for n, g in zip(names, NAMES, strict=True)} | {"t.txt": CHINESE_LIST.encode("gb18030")}
    data = packed(files).replace(b"PICS", gb)
    assert all(not m.flag_bits & 0x800 for m in zipfile.ZipFile(io.BytesIO(data)).infolist())
    bracket = load_bracket(a_zip(data)(tmp_path))
    assert bracket.names == ("照片1.png", "照片2.png", "照片3.png")
    np.testing.assert_allclose(bracket.times, TIMES)


@pytest.mark.parametrize("outside", ["../../", "/abs/", "..\\..\\", "C:\\abs\\", "a/../../../"], ids=repr)
def test_a_zip_can_not_write_outside_and_loads(tmp_path, monkeypatch, outside):
    deep = tmp_path / "one" / "two" / "three"
    path = a_zip(packed({outside + name: data for name, data in GOOD.items()}))(deep)
    monkeypatch.chdir(deep)
    before, root = contents(tmp_path), sorted(Path("/").iterdir())
    bracket = load_bracket(path)
    assert contents(tmp_path) == before and sorted(Path("/").iterdir()) == root
    assert bracket.names == NAMES


def test_one_evil_name_among_good_ones_writes_nothing(tmp_path, monkeypatch):
    deep = tmp_path / "one" / "two"
    path = a_zip(packed({"../../evil.png": GOOD["a_1.png"], **GOOD}))(deep)
    monkeypatch.chdir(deep)
    before = contents(tmp_path)
    with pytest.raises(BracketError, match=r"evil\.png"):
        load_bracket(path)  # it counts as a photograph, and the list has no time for it
    assert contents(tmp_path) == before


def test_40_million_pixels_are_loaded(tmp_path):
    for i, image in enumerate(scene(966, 644)[::2]):
        large = np.tile(image, (8, 8, 1))
        cv2.imwrite(str(tmp_path / f"a_{i}.jpg"), large[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 50])
    (tmp_path / "t.txt").write_text("1/60 1/15")
    bracket = load_bracket(tmp_path)
    assert [image.shape for image in bracket.images] == [(5152, 7728, 3)] * 2
    assert all(image.dtype == np.uint8 for image in bracket.images)
    np.testing.assert_allclose(bracket.times, (1 / 60, 1 / 15))


# ---------------------------------------------------------------------------------------- chance

TINY = scene(24, 16)[1]
SEEDS = {
    "JPEG": in_pillow(TINY, ".jpg"),
    "PNG": in_pillow(TINY, ".png"),
    "TIFF": in_pillow(TINY, ".tif"),
    "TIFF packed": in_pillow(TINY, ".tif", compression="tiff_lzw"),
    "TIFF of 16 bits": in_opencv(TINY.astype(np.uint16) * 257, ".tif"),
    "PNG with alpha": in_pillow(with_alpha(TINY, SOLID[:16, :24] * 255), ".png"),
    "TIFF with alpha": in_pillow(with_alpha(TINY, SOLID[:16, :24] * 255), ".tif"),
}


def damaged(data, chance):
    """The same bytes with one of them changed, or cut short."""
    if chance.random() < 0.3:
        return data[: chance.randrange(len(data))]
    data = bytearray(data)
    data[chance.randrange(len(data))] ^= chance.randrange(1, 256)
    return bytes(data)


@pytest.mark.parametrize("kind", SEEDS)
def test_a_damaged_file_is_a_photograph_or_refused_by_name(kind):
    chance = random.Random(f"{kind} 2")
    for _ in range(50):
        try:
            photograph = decode("some.picture", damaged(SEEDS[kind], chance))
        except BracketError as problem:
            assert "some.picture" in str(problem)
            continue
        assert type(photograph) is Photograph
        height, width, channels = photograph.image.shape
        assert channels == 3 and photograph.image.dtype in (np.uint8, np.uint16)
        assert photograph.opaque is None or photograph.opaque.shape == (height, width)


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_damaged_zip_is_a_bracket_or_refused(tmp_path, compression):
    chance = random.Random(compression)
    data = packed({"照1.png": SEEDS["PNG"], "照2.png": in_pillow(TINY // 2, ".png"), "t.txt": "1 0.5"}, compression)
    directory = data.index(CENTRAL)
    for i in range(60):
        spoilt = data[:directory] + damaged(data[directory:], chance) if i % 2 else damaged(data, chance)
        try:
            assert len(load_bracket(a_zip(spoilt)(tmp_path))) == 2
        except BracketError as problem:
            assert "\n" not in str(problem)


def test_no_exif_block_upsets_the_reader():
    chance = random.Random(4)
    exif = Image.Exif()
    exif[0x0112] = 6
    exif.get_ifd(0x8769).update({0x829A: IFDRational(1, 60), 0x829D: IFDRational(28, 10), 0x8827: 200})
    good = exif.tobytes()
    assert read_exif(good) == (1 / 60, 200, 2.8, 6)
    for i in range(3000):
        if i % 3 == 0:
            block = chance.choice([b"", b"II*\0", b"MM\0*", b"Exif\0\0II"]) + chance.randbytes(chance.randrange(120))
        else:
            block = good
            for _ in range(chance.randrange(1, 6)):
                block = damaged(block, chance) or b"\0"
        for value in read_exif(block):
            assert value is None or (np.isfinite(value) and value >= 0)
