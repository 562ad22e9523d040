"""Libraries of kernels: hand-written ones, linked for this machine and called; and for the others, linked."""

import ctypes
import importlib.util
import math

import pytest
from llvmlite import binding

from carom.lab.build import linker
from carom.lab.build.errors import BuildError
from carom.lab.build.glue import Entry, glue
from carom.lab.build.objects import assemble, retarget
from carom.lab.build.platforms import PLATFORMS, native

# As numba makes them: int32 status f(int64 *result, excinfo **error, arguments...).
KERNELS = """
declare double @floor(double)
declare double @llvm.ceil.f64(double)
declare double @trunc(double)
declare double @llvm.rint.f64(double)
declare double @sqrt(double)
declare i64 @llvm.readcyclecounter()
@NumbaEnv = common global ptr null
define i32 @add(ptr %result, ptr %error, i64 %a, double %b, i8 %c) {
  %whole = fptosi double %b to i64
  %flag = zext i8 %c to i64
  %two = add i64 %a, %whole
  %sum = add i64 %two, %flag
  store i64 %sum, ptr %result
  %negative = icmp slt i64 %sum, 0
  store ptr inttoptr (i64 4096 to ptr), ptr %error
  %status = zext i1 %negative to i32
  ret i32 %status
}
define i32 @ticks(ptr %result, ptr %error) {
  %now = call i64 @llvm.readcyclecounter()
  store i64 %now, ptr %result
  ret i32 0
}
define i32 @nothing(ptr %result, ptr %error) {
  ret i32 0
}
define i32 @round(ptr %into, ptr %error, double %x) {
  %floor = call double @floor(double %x)
  %ceil = call double @llvm.ceil.f64(double %x)
  %trunc = call double @trunc(double %x)
  %rint = call double @llvm.rint.f64(double %x)
  %root = call double @sqrt(double %x)
  store double %floor, ptr %into
  %second = getelementptr double, ptr %into, i64 1
  store double %ceil, ptr %second
  %third = getelementptr double, ptr %into, i64 2
  store double %trunc, ptr %third
  %fourth = getelementptr double, ptr %into, i64 3
  store double %rint, ptr %fourth
  %fifth = getelementptr double, ptr %into, i64 4
  store double %root, ptr %fifth
  ret i32 0
}
"""
ENTRIES = (
    Entry("add", "k_add", ("int64", "float64", "bool")), Entry("ticks", "k_ticks", ()),
    Entry("nothing", "k_nothing", (), result="none"),
)  # fmt: skip
FACTS = {"version": '1.0 "é"', "empty": ""}
ZIG = importlib.util.find_spec("ziglang") is not None


def objects(platform, text=KERNELS):
    names = {name: f"k_{name}" for name in ("add", "ticks", "nothing", "round")}
    return [
        retarget(binding.parse_assembly(text).as_bitcode(), platform, names),
        assemble(glue("_tried", ENTRIES, {"round": "k_round", "again": "k_add"}, FACTS, platform), platform),
    ]


def build(folder, platform, parts=None):
    output = folder / f"_tried{platform.suffix}"
    linker.link(parts if parts is not None else objects(platform), output, platform)
    return output


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    platform = native()
    if platform is None:
        pytest.skip("carom builds no libraries for this platform")
    try:
        path = build(tmp_path_factory.mktemp("library"), platform)
    except BuildError as error:
        if "there is no linker" in str(error):
            pytest.skip(str(error))
        raise
    spec = importlib.util.spec_from_file_location("_tried", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_entries_convert_numbers_and_answer(library):
    assert library.add(40, 2.9, False) == 42
    assert library.add(-1, 3, True) == 3  # -1 is what a failed conversion gives, too
    assert library.add(3, -1.0, 1) == 3
    assert library.nothing() is None
    first = library.ticks()
    assert library.ticks() > first
    assert library.facts == FACTS


def test_entries_refuse_what_is_no_number(library):
    with pytest.raises(TypeError, match=r"add\(\) takes 3 arguments, not 2"):
        library.add(1, 2.0)
    with pytest.raises(TypeError, match="str"):
        library.add(1, "2", True)
    with pytest.raises(TypeError, match="float"):
        library.add(1.5, 2.0, True)
    with pytest.raises(OverflowError):
        library.add(2**70, 2.0, True)


def test_a_status_becomes_what_the_handler_raises(library):
    seen = []

    def handler(status, address):
        seen.append((status, address))
        raise KeyError("from the kernel")

    with pytest.raises(RuntimeError, match="status 1"):
        library.add(-9, 0.0, False)
    library.set_error_handler(handler)
    with pytest.raises(KeyError, match="from the kernel"):
        library.add(-9, 0.0, False)
    assert seen == [(1, 4096)]
    library.set_error_handler(lambda status, address: None)
    with pytest.raises(RuntimeError, match="raised nothing"):
        library.add(-9, 0.0, False)


def test_rounding_is_exact_and_keeps_signs(library):
    round_ = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double)(
        library.addresses["round"]
    )
    into = (ctypes.c_double * 5)()
    halves = [sign * (k + half) for k in range(4) for half in (0.0, 0.25, 0.5, 0.75) for sign in (1.0, -1.0)]
    large = [2.0**52 - 0.5, 2.0**52 + 1.0, -(2.0**53) - 2.0, 1e300, 5e-324, -5e-324]
    for x in halves + large:
        assert round_(ctypes.addressof(into), None, x) == 0
        expected = [float(math.floor(x)), float(math.ceil(x)), float(math.trunc(x)), float(round(x))]
        expected = [math.copysign(value, x) for value in expected]  # of zeros; all others have that sign
        assert [value.hex() for value in into[:4]] == [value.hex() for value in expected], x
        if x >= 0.0:
            assert into[4] == math.sqrt(x)
    for x in (math.inf, -math.inf):
        round_(ctypes.addressof(into), None, x)
        assert into[:4] == [x] * 4
    round_(ctypes.addressof(into), None, math.nan)
    assert all(math.isnan(value) for value in into)


@pytest.mark.slow
@pytest.mark.skipif(not ZIG, reason="the extra build is not installed")
@pytest.mark.parametrize("name", PLATFORMS)
def test_every_platform_is_linked_from_here_always_to_the_same_file(name, tmp_path):
    platform = PLATFORMS[name]
    path = build(tmp_path, platform)
    content = path.read_bytes()
    start = {"win-amd64": b"MZ", "macos-arm64": b"\xcf\xfa\xed\xfe", "wasm32": b"\0asm"}.get(name, b"\x7fELF")
    assert content.startswith(start)
    assert b"PyInit__tried" in content
    assert b"k_round" not in content  # stripped
    assert str(tmp_path).encode() not in content
    again = tmp_path / "again"
    again.mkdir()
    assert build(again, platform).read_bytes() == content


def test_what_only_numba_has_is_refused_with_the_kernels_name():
    text = (
        "declare ptr @numba_unpickle(ptr)\n"
        "define i32 @add(ptr %r, ptr %e) {\n  %o = call ptr @numba_unpickle(ptr %r)\n  ret i32 0\n}"
    )
    with pytest.raises(BuildError, match=r"k_add: .* numba_unpickle"):
        retarget(binding.parse_assembly(text).as_bitcode(), PLATFORMS["linux-aarch64"], {"add": "k_add"})


def test_what_no_process_has_is_refused(tmp_path):
    platform = native()
    if platform is None or not platform.name.startswith("linux"):
        pytest.skip("other linkers say it themselves")
    text = "declare void @nowhere()\ndefine void @PyInit__tried() {\n  call void @nowhere()\n  ret void\n}"
    with pytest.raises(BuildError, match=r"_tried.abi3.so calls nowhere"):
        build(tmp_path, platform, [assemble(text, platform)])


def test_without_a_linker_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(linker.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(linker.shutil, "which", lambda name: None)
    with pytest.raises(BuildError, match=r"no linker here for wasm32: install .*carom\[build\]"):
        build(tmp_path, PLATFORMS["wasm32"], [])


def test_arguments_that_are_no_numbers_are_refused():
    with pytest.raises(ValueError, match=r"add: an entry takes numbers \(int64, float64, bool, address\), not record"):
        glue("_tried", [Entry("add", "k_add", ("record",))], {}, {}, PLATFORMS["win-amd64"])


@pytest.mark.parametrize("name", ["linux-aarch64", "macos-arm64"])
def test_products_and_sums_stay_apart_on_arm(name):
    """A fused one would have other bits than x86-64."""
    platform = PLATFORMS[name]
    module = binding.parse_assembly(
        "define double @f(double %a, double %b, double %c) {\n  %p = fmul double %a, %b\n"
        "  %s = fadd double %p, %c\n  ret double %s\n}"
    )
    module.triple, module.data_layout = platform.triple, str(platform.target_machine.target_data)
    text = platform.target_machine.emit_assembly(module)
    assert "fmul" in text
    assert "fmadd" not in text
