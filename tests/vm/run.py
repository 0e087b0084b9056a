#!/usr/bin/env python3
"""Boots a PREEMPT_RT guest and runs tests in it: see README.md.

Exit codes: 0 all passed; 1 a test failed, or the guest did not finish; 2 a wrong option;
77 the guest cannot run on this machine, said in a sentence.
"""
import argparse
import lzma
import os
import re
import selectors
import shutil
import subprocess
import sys
import time
from pathlib import Path

EXIT_SKIPPED = 77
SOURCES = Path(__file__).resolve().parent
KERNEL = "linux-image-rt-amd64"
# The manager of device nodes: libusb and libudev learn from it what is plugged in and out.
UDEV = "udev"
MODULES = ("uhid", "hid-generic", "vhci-hcd", "uinput", "evdev", "joydev")
# Those with the tests; the others are built only where their driver's library is.
TEST_PROGRAMS = ("vm_test", "device_evdev_uinput_test")
PROGRAMS = ("rtpm-registryd", "rtpm-deviced", "rtpm")
# The guest's CPUs. `virtual`: one, whose clock counts its instructions, 4 ns each, and skips idle
# time: a busy host delays nothing that the tests see, and waiting costs nothing.
MACHINES = {"virtual": ("-accel", "tcg,thread=single", "-icount", "shift=2,sleep=off",
                        "-smp", "1"),
            "tcg": ("-accel", "tcg,thread=multi", "-smp", "2"),
            "kvm": ("-accel", "kvm", "-smp", "2")}
CONSOLE_LINES = 25
NEEDED_TOOLS = {"qemu-system-x86_64": "qemu-system-x86", "busybox": "busybox-static",
                "cpio": "cpio", "depmod": "kmod", "strip": "binutils", "ldd": "libc-bin",
                "apt-get": "apt", "dpkg-deb": "dpkg"}


class Unavailable(Exception):
    """Why the guest cannot run on this machine, with the remedy."""


def tool(name):
    path = shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")
    if path is None:
        raise Unavailable(f"{name} is missing. Remedy: apt-get install {NEEDED_TOOLS[name]}")
    return path


def run(*command, **options):
    return subprocess.run([str(word) for word in command], check=True, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options).stdout


# ---- packages: unpacked beside the build, never installed on this machine -----------------------

def ask_apt(*command, folder):
    """What `command` prints; renews the package lists and tries again if it fails."""
    try:
        return run(*command, cwd=folder)
    except subprocess.CalledProcessError as error:
        if os.geteuid() == 0:
            subprocess.run([tool("apt-get"), "-qq", "update"], check=False)
            try:
                return run(*command, cwd=folder)
            except subprocess.CalledProcessError as second:
                error = second
        reason = (error.output.strip().splitlines() or ["no reason given"])[-1]
        raise Unavailable(f"{' '.join(command)} failed: {reason}. "
                          "Remedy: as root, apt-get update") from None


def unpacked(package, cache):
    """The folder with the files of a Debian package, downloaded once."""
    folder = cache / package
    if folder.exists():
        return folder
    print(f"test-vm: downloading the package {package}", flush=True)
    download, partial = cache / "download", cache / "partial"
    for scratch in (download, partial):
        shutil.rmtree(scratch, ignore_errors=True)
        scratch.mkdir(parents=True)
    ask_apt("apt-get", "-qq", "-o", "APT::Sandbox::User=root", "download", package, folder=download)
    run(tool("dpkg-deb"), "-x", next(download.glob("*.deb")), partial)
    shutil.rmtree(download)
    partial.rename(folder)
    return folder


def kernel_package(cache):
    """The package that has the kernel itself; one that is at hand is taken."""
    at_hand = sorted(cache.glob("linux-image-[0-9]*-rt-amd64"))
    if at_hand:
        return at_hand[-1].name
    cache.mkdir(parents=True, exist_ok=True)
    text = ask_apt("apt-cache", "--no-all-versions", "show", KERNEL, folder=cache)
    found = re.search(r"linux-image-[0-9][\w.+-]*-rt-amd64", text)
    if not found:
        raise Unavailable(f"the package {KERNEL} names no kernel. Remedy: Debian's amd64 packages")
    return found.group()


# ---- the guest's file system --------------------------------------------------------------------

class FileSystem:
    """The initramfs as a folder."""

    def __init__(self, root):
        self.root = root
        shutil.rmtree(root, ignore_errors=True)
        for folder in ("bin", "sbin", "dev", "proc", "sys", "tmp", "run", "etc", "tests",
                       "usr/bin", "lib/modules", "var/log"):
            (root / folder).mkdir(parents=True)

    def add(self, source, path):
        target = self.root / str(path).lstrip("/")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, target)
        return target

    def add_program(self, source, path):
        """A program without its debug information, and the libraries that it loads."""
        target = self.add(source, path)
        run(tool("strip"), "--strip-debug", target)
        for line in run(tool("ldd"), source).splitlines():
            if "not found" in line:
                raise Unavailable(f"{source} needs {line.split()[0]}, which is not installed")
            found = re.search(r"(/\S+) \(0x", line)
            if found and not (self.root / found.group(1).lstrip("/")).exists():
                self.add(found.group(1), found.group(1))

    def add_modules(self, kernel, version):
        """MODULES with those that they depend on, and the tables by which udev finds them."""
        source = kernel / "lib/modules" / version
        if not (source / "modules.dep").exists():
            run(tool("depmod"), "-b", kernel, version)
        needs = {}
        for line in (source / "modules.dep").read_text().splitlines():
            module, _, others = line.partition(":")
            name = re.sub(r"\.ko.*", "", module.rpartition("/")[2])
            needs[name.replace("_", "-")] = [module, *others.split()]
        for name in MODULES:
            for module in needs.get(name, []):
                path = f"lib/modules/{version}/{module.removesuffix('.xz')}"
                target = self.add(source / module, path)
                if module.endswith(".xz"):
                    target.write_bytes(lzma.decompress((source / module).read_bytes()))
        for table in ("modules.builtin", "modules.builtin.modinfo", "modules.order"):
            self.add(source / table, f"lib/modules/{version}/{table}")
        run(tool("depmod"), "-b", self.root, version)

    def add_udev(self, package):
        self.add_program(next(package.rglob("bin/udevadm")), "/bin/udevadm")
        for name in ("50-udev-default.rules", "60-input-id.rules", "80-drivers.rules"):
            self.add(next(package.rglob(f"rules.d/{name}")), f"/lib/udev/rules.d/{name}")
        # The groups that the rules name.
        names = ("root", "tty", "input", "dialout", "kmem", "disk", "lp", "video", "audio", "cdrom",
                 "tape", "render", "kvm", "sgx")
        (self.root / "etc/group").write_text(
            "".join(f"{name}:x:{number}:\n" for number, name in enumerate(names)))
        (self.root / "etc/passwd").write_text("root:x:0:0::/tmp:/bin/sh\n")

    def write_image(self, image):
        names = "\0".join(str(path.relative_to(self.root)) for path in sorted(self.root.rglob("*")))
        with open(image, "wb") as output:
            subprocess.run([tool("cpio"), "--null", "-o", "-H", "newc", "-R", "0:0", "--quiet"],
                           input=names.encode(), stdout=output, cwd=self.root, check=True)


def tests_of(folder, pattern):
    """The cases of the test programs that match: the program of each name."""
    programs = {}
    if not (folder / TEST_PROGRAMS[0]).exists():
        raise Unavailable(f"{folder} has no {TEST_PROGRAMS[0]}. Remedy: apt-get install "
                          "pkg-config libusb-1.0-0-dev, and build again")
    for program in TEST_PROGRAMS:
        if not (folder / program).exists():
            continue
        suite = ""
        for line in run(folder / program, "--gtest_list_tests",
                        f"--gtest_filter={pattern}").splitlines():
            line = line.split("#")[0].rstrip()
            if line.startswith("  "):
                programs[suite + line.strip()] = program
            elif line.endswith("."):
                suite = line
    return programs


def write_guest(options, cache, tests):
    """Writes the guest's kernel and its file system; returns their paths."""
    kernel = unpacked(kernel_package(cache), cache)
    version = next((kernel / "lib/modules").iterdir()).name
    guest = FileSystem(options.folder / "root")
    guest.add(tool("busybox"), "/bin/busybox")
    guest.add(SOURCES / "init.sh", "/init").chmod(0o755)
    guest.add_modules(kernel, version)
    guest.add_udev(unpacked(UDEV, cache))
    for program in sorted({*tests.values(), *PROGRAMS}):
        guest.add_program(options.build / "bin" / program, f"/tests/{program}")
    (guest.root / "tests/modules").write_text("\n".join(MODULES) + "\n")
    (guest.root / "tests/list").write_text(
        "".join(f"{options.test_deadline} {tests[name]} {name}\n" for name in tests))
    image = options.folder / "initramfs"
    guest.write_image(image)
    return kernel / "boot" / f"vmlinuz-{version}", image


# ---- running ------------------------------------------------------------------------------------

class Results:
    """Reads what the guest prints and says it as ctest does."""

    def __init__(self, tests):
        self.tests = tests
        self.outcomes = {}
        self.running = None
        self.is_finished = False
        self.output = []

    def take(self, line):
        if line.startswith("@begin "):
            self.running, self.output = line.split()[1], []
        elif line.startswith("@end ") and self.running:
            _, name, exit_code, hundredths = line.split()
            self.end(name, int(exit_code), int(hundredths) / 100)
            self.running = None
        elif line.startswith("@done"):
            self.is_finished = True
        elif self.running:
            self.output.append(line)
        else:
            print(f"test-vm: {line}", flush=True)

    def end(self, name, exit_code, seconds):
        is_skipped = any(line.startswith("[  SKIPPED ]") for line in self.output)
        has_run = any(line.startswith("[  PASSED  ] 1 test") for line in self.output)
        if exit_code == 137:
            outcome = "Timeout"
        elif exit_code != 0:
            outcome = "Failed"
        elif is_skipped:
            outcome = "Skipped"
        else:
            outcome = "Passed" if has_run else "Failed"
        self.outcomes[name] = outcome
        mark = "   " if outcome == "Passed" else "***"
        print(f"{len(self.outcomes):>3}/{len(self.tests)} Test: {name + ' ':.<60}{mark}{outcome:<8}"
              f"{seconds:6.2f} sec", flush=True)
        for line in self.output:
            if outcome not in ("Passed",) or line.startswith("note: "):
                print("    " + line, flush=True)

    def failed(self):
        return [name for name in self.tests
                if self.outcomes.get(name, "Not Run") not in ("Passed", "Skipped")]

    def print_summary(self, seconds):
        failed = self.failed()
        passed_percent = 100 * (len(self.tests) - len(failed)) // len(self.tests)
        print(f"\n{passed_percent}% tests passed, {len(failed)} tests failed "
              f"out of {len(self.tests)}\n\nTotal Test time (real) = {seconds:.2f} sec")
        for title, outcome in (("did not run", "Skipped"), ("FAILED", None)):
            names = failed if outcome is None else \
                [name for name in self.tests if self.outcomes.get(name) == outcome]
            if names:
                print(f"\nThe following tests {title}:")
            for name in names:
                number = self.tests.index(name) + 1
                print(f"\t{number:>3} - {name} ({self.outcomes.get(name, 'Not Run')})")
        sys.stdout.flush()


def lines_until(process, deadline):
    """The lines that the guest prints until it ends or the deadline is over."""
    text = b""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while selector.select(max(0, deadline - time.monotonic())):
            chunk = os.read(process.stdout.fileno(), 65536)
            if not chunk:
                return
            *lines, text = (text + chunk).split(b"\n")
            for line in lines:
                yield line.decode(errors="replace").rstrip("\r")


def boot(options, kernel, image, results):
    """Runs the guest to its end or its deadline; returns why it did not finish, if so."""
    console = options.folder / "console.txt"
    command = [tool("qemu-system-x86_64"), *MACHINES[options.machine], "-cpu", "max", "-m", "1024",
               "-nodefaults",
               "-no-user-config", "-no-reboot", "-display", "none", "-monitor", "none",
               "-rtc", "base=2026-01-01,clock=vm", "-serial", f"file:{console}", "-serial", "stdio",
               "-kernel", str(kernel), "-initrd", str(image),
               # After a panic the guest restarts at once, which ends it here.
               "-append", "console=ttyS0 loglevel=5 panic=-1 oops=panic"]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT)
    try:
        for line in lines_until(process, time.monotonic() + options.deadline):
            results.take(line)
        # Having said all, it has a moment to power off.
        process.wait(timeout=10)
        reason = "the guest ended before it had run all tests"
    except subprocess.TimeoutExpired:
        reason = f"the guest did not finish within {options.deadline} s"
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    if results.is_finished:
        return None
    lines = console.read_text(errors="replace").splitlines()
    panics = [number for number, line in enumerate(lines)
              if re.search(r"Kernel panic|Oops:|BUG: ", line)]
    if panics:
        reason = f"the guest's kernel has failed: {re.sub(r'^.*?[]] ', '', lines[panics[0]])}"
        lines = lines[:panics[0] + CONSOLE_LINES]
    running = f", while it ran {results.running}" if results.running else ""
    shown = [*results.output[-CONSOLE_LINES:], *lines[-CONSOLE_LINES:]]
    return (f"{reason}{running}. The last lines of the test and of {console}:\n" +
            "\n".join("    " + line for line in shown))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--build", type=Path, required=True, help="the folder with bin/vm_test")
    add("--folder", type=Path, required=True, help="for the guest's files; kept")
    add("--filter", default="*", help="the tests to run, as --gtest_filter takes it")
    add("--deadline", type=int, default=480, help="for all, in seconds of the host's time")
    add("--test-deadline", type=int, default=60, help="for each, in seconds of the guest's time")
    add("--machine", choices=MACHINES, default="virtual",
        help="virtual: its time counts its instructions; tcg: software emulation in the host's "
             "time; kvm: hardware virtualisation")
    return parser.parse_args()


def main():
    options = arguments()
    begin = time.monotonic()
    try:
        for name in NEEDED_TOOLS:
            tool(name)
        tests = tests_of(options.build / "bin", options.filter)
        if not tests:
            print(f"test-vm: no test matches '{options.filter}'")
            return 2
        kernel, image = write_guest(options, options.folder / "packages", tests)
    except Unavailable as reason:
        print(f"test-vm: SKIPPED, no test ran in a guest: {reason}.")
        return EXIT_SKIPPED
    except subprocess.CalledProcessError as error:
        print(f"test-vm: {' '.join(error.cmd)} failed:\n{error.output}")
        return 1
    print(f"test-vm: booting {kernel.name} with {image.stat().st_size >> 20} MB of files",
          flush=True)
    results = Results(list(tests))
    reason = boot(options, kernel, image, results)
    if reason:
        print(f"test-vm: {reason}")
    results.print_summary(time.monotonic() - begin)
    return 1 if reason or results.failed() else 0


if __name__ == "__main__":
    sys.exit(main())
