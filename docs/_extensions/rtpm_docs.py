"""What Sphinx does not know of RTPM's tree: anchors of the specification, texts of its programs.

Markdown is rewritten as it is read: `<!-- generated: NAME -->` becomes the text of a function below,
a link to a folder one to its README, and a picture for light and dark a pair of images.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from docutils import nodes  # type: ignore[import-untyped]
from pygments.lexers import ProtoBufLexer, TextLexer  # type: ignore[import-untyped]
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

TREE = Path(__file__).resolve().parents[2]
ANCHOR = re.compile(r"\s*\{#([\w.-]+)\}\s*$")


def slug(title: str) -> str:
    """The anchor of a heading: the one it states, `## 1 Overview {#hp-1}`, else GitHub's."""
    if stated := ANCHOR.search(title):
        return stated.group(1)
    return re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-")


class StatedAnchors(SphinxTransform):
    """Takes `{#hp-1}` out of headings, whose anchors are known by then."""

    default_priority = 5

    def apply(self, **_: Any) -> None:
        for title in self.document.findall(nodes.title):
            for text in list(title.findall(nodes.Text)):
                shown = ANCHOR.sub("", str(text))
                if shown != str(text):
                    text.parent.replace(text, nodes.Text(shown))
            title.rawsource = ANCHOR.sub("", title.rawsource)


class ShortContents(SphinxTransform):
    """Keeps members out of tables of contents: classes are headings, and the build is quicker."""

    default_priority = 870  # Before Sphinx collects the contents, at 880.

    def apply(self, **_: Any) -> None:
        for signature in self.document.findall(addnodes.desc_signature):
            signature["_toc_name"] = ""


# ---- generated pages ----------------------------------------------------------------------------


def output_of(programs: Path, name: str, *arguments: str) -> str:
    """The program's text, without anything of the machine and the user that build this page."""
    environment = {"PATH": os.environ["PATH"], "HOME": "/nonexistent", "COLUMNS": "80"}
    if not (programs / name).exists():
        raise FileNotFoundError(f"{name} is not in {programs}. Remedy: ./dev docs builds it")
    done = subprocess.run(
        [programs / name, *arguments],
        capture_output=True,
        text=True,
        timeout=20,
        check=True,
        env=environment,
    )
    return done.stdout.rstrip()


def fenced(text: str) -> str:
    return f"````text\n{text}\n````\n"


#: The programs that RTPM installs, in the order of a newcomer's interest; `rtpm` has a page of its own.
PROGRAMS = {
    "rtpm-registryd": "--help-all",
    "rtpm-deviced": "--help-all",
    "rtpm-eventd": "--help-all",
    "rtpm-console": "--help-all",
    "rtpm-camerad": "--help-all",
    "rtpm-media": "--help-all",
    "rtpm-servo": "--help-all",
    "rtpm-scene": "--help-all",
    "rtpm-display": "--help-all",
    "rtpm-figure5": "--help-all",
    "rtpm-ros2": "--help-all",
    "rtpm-vrpn": "--help-all",
    "rtpm-event-bridge": "--help-all",
    "rtpmc": "--help",
    "rtpm-bench": "--help",
}


def options_of_programs(app: Sphinx) -> Iterator[str]:
    programs = Path(app.config.rtpm_programs)
    for name, option in PROGRAMS.items():
        text = output_of(programs, name, option)
        subject, _, rest = text.partition("\n")
        if subject.startswith(f"{name}: "):
            subject, text = subject.removeprefix(f"{name}: "), rest
        else:
            subject = ""
        yield f"## {name}\n"
        if subject:
            yield f"{subject[0].upper()}{subject[1:]}.\n"
        yield fenced(text)


def commands_of_rtpm(app: Sphinx) -> Iterator[str]:
    programs = Path(app.config.rtpm_programs)
    top = output_of(programs, "rtpm", "--help")
    yield fenced(top)
    listed = top.partition("Commands:\n")[2].partition("\n\n")[0]
    for line in listed.splitlines():
        name, _, subject = line.strip().partition(" ")
        yield f"## rtpm {name}\n\n{subject.strip()}.\n"
        yield from help_of(programs, name)


def help_of(programs: Path, *words: str) -> Iterator[str]:
    """The help of a command, and of the commands below it."""
    text = output_of(programs, "rtpm", *words, "--help")
    yield fenced(text)
    listed = text.partition("Commands:\n")[2].partition("\n\n")[0]
    for line in listed.splitlines():
        if found := re.match(r"  ([a-z][a-z-]*)", line):
            yield f"### rtpm {' '.join(words)} {found.group(1)}\n"
            yield from help_of(programs, *words, found.group(1))


#: Functions to_string() whose texts have cause and remedy: source, enumeration, title, introduction.
TABLES = (
    (
        "runtime/rpc/src/error.cpp",
        "CallError",
        "A call failed",
        "C++: `rtpm::rpc::CallError`; Python: a class of the same name, derived from `rtpm.CallError`.",
    ),
    (
        "gvd/service/src/error.cpp",
        "DeviceOutcome",
        "A device refused a command",
        "C++: `rtpm::gvd::DeviceError`; Python: classes derived from `rtpm.DeviceError`.",
    ),
    (
        "gvd/configuration/src/error.cpp",
        "ConfigurationOutcome",
        "A parameter or a calibration was refused",
        "`rtpm config`, and `rtpm::configuration`.",
    ),
    (
        "registry/events/src/hub/disconnects.cpp",
        "DisconnectReason",
        "A hub dropped a consumer or a supplier",
        "In the hub's report and on its standard error.",
    ),
    (
        "runtime/rpc/src/calls/pending.cpp",
        "StreamError",
        "A servant's stream ended",
        "At the server that answers with a stream.",
    ),
    (
        "protocol/crypto/src/handshake.cpp",
        "HandshakeError",
        "A sealed session was not opened",
        "Keys and sessions: [security](/docs/security.md).",
    ),
)
LITERAL = r'"(?:[^"\\]|\\.)*"'


def cases_of(source: str, enumeration: str) -> list[tuple[str, str]]:
    """The pairs of `case Enumeration::kName: return "text";`."""
    found = re.findall(
        rf"case {enumeration}::k(\w+):\s*(?://[^\n]*\n\s*)*return\s+((?:{LITERAL}\s*)+);", source
    )
    joined = (
        (name, "".join(part[1:-1] for part in re.findall(LITERAL, text))) for name, text in found
    )
    return [(name, text.replace('\\"', '"')) for name, text in joined]


def messages(app: Sphinx) -> Iterator[str]:
    for path, enumeration, title, introduction in TABLES:
        pairs = cases_of((TREE / path).read_text(), enumeration)
        if not pairs:
            raise ValueError(f"{path}: no text of {enumeration} was found")
        yield f"## {title}\n\n{introduction}\n\n| Name | Message, with its remedy |\n|---|---|"
        for name, text in pairs:
            yield f"| `{name}` | {text.replace('|', chr(92) + '|')} |"
        yield ""


# ---- the gallery --------------------------------------------------------------------------------


LANGUAGES = {".cpp": "cpp", ".js": "js", ".py": "python"}
#: A docstring, or the comment at the beginning.
INTRODUCTION = re.compile(r'(?:#!.*\n)?"""((?:.|\n)*?)"""\n+|((?://.*\n)+)')


def gallery(app: Sphinx) -> Iterator[str]:
    """Each program of examples/, behind what it says of itself."""
    for path in sorted((TREE / "examples").iterdir()):
        language = LANGUAGES.get(path.suffix)
        text = path.read_text("utf-8") if language else ""
        found = INTRODUCTION.match(text)
        if language is None or found is None or path.stem == "pictures":
            continue
        lines = (found.group(1) or found.group(2)).strip().splitlines()
        # Commands in it are indented, which makes them code.
        introduction = "\n".join(re.sub(r"^// ?", "", line) for line in lines)
        begin = found.group().count("\n") + 1
        yield (
            f"## {path.stem}\n\n{introduction}\n\n"
            f"```{{literalinclude}} /examples/{path.name}\n"
            f":language: {language}\n:lines: {begin}-\n```\n"
        )


# ---- the parts ----------------------------------------------------------------------------------

#: Pages that stand elsewhere in the tree of pages.
ELSEWHERE = re.compile(
    r"docs/|spec/|ARCHITECTURE$|CHANGELOG$|gvd/README$|gvd/driver/TUTORIAL$|schema/(README|TUTORIAL)$"
    r"|bench/(RESULTS|PYTHON)$|registry/(events/FILTERS|predicate/README)$"
)


def parts(app: Sphinx) -> Iterator[str]:
    """All other pages of the tree, by folder."""
    folders: dict[str, list[str]] = {}
    for name in sorted(app.env.found_docs):
        if not ELSEWHERE.match(name):
            folder = name.partition("/")[0] if "/" in name else "the tree"
            folders.setdefault(folder, []).append(name)
    for folder, names in folders.items():
        # No toctree: a navigation of so many entries would take most of the build's time.
        lines = "\n".join(f"- `{name}.md`: [](/{name}.md)" for name in names)
        yield f"## {folder}\n\n{lines}\n"


# ---- Doxygen ------------------------------------------------------------------------------------

DOXYFILE = """
QUIET = YES
WARNINGS = NO
WARN_IF_UNDOCUMENTED = NO
WARN_IF_INCOMPLETE_DOC = NO
WARN_IF_DOC_ERROR = NO
GENERATE_HTML = NO
GENERATE_LATEX = NO
GENERATE_XML = YES
XML_PROGRAMLISTING = NO
JAVADOC_AUTOBRIEF = YES
MACRO_EXPANSION = YES
EXTRACT_LOCAL_CLASSES = NO
# Doxygen 1.9.4 does not know `namespace a::inline b`.
INPUT_FILTER = "sed -E 's/::inline [A-Za-z_]+ /  /'"
ALIASES = "threads=\\par Threads^^" "realtime=\\par Real time^^" "errors=\\par Errors^^"
ALIASES += "ownership=\\par Ownership^^" "source=\\par Source^^"
"""


def public_headers() -> list[Path]:
    text = (TREE / "cmake" / "RtpmPublicHeaders.cmake").read_text("utf-8")
    names = re.findall(r"^\s+(rtpm/\S+\.hpp)", text, re.MULTILINE)
    folders = [*TREE.glob("*/*/include"), *TREE.glob("*/*/*/include")]
    found = ((folder / name for folder in folders if (folder / name).exists()) for name in names)
    return [path for paths in found for path in paths]


def describe_headers(app: Sphinx, _: Any) -> None:
    """Lets Doxygen write the XML that Breathe reads."""
    output = Path(app.config.breathe_projects["rtpm"]).parent
    headers = public_headers()
    index = output / "xml" / "index.xml"
    newest = max(path.stat().st_mtime for path in [*headers, Path(__file__)])
    if index.exists() and index.stat().st_mtime > newest:
        return
    output.mkdir(parents=True, exist_ok=True)
    inputs = " ".join(f'"{path}"' for path in headers)
    configuration = f'{DOXYFILE}\nOUTPUT_DIRECTORY = "{output}"\nINPUT = {inputs}\n'
    done = subprocess.run(
        ["doxygen", "-"],
        input=configuration,
        text=True,
        check=False,
        timeout=120,
        stderr=subprocess.PIPE,
    )
    if done.returncode != 0:
        raise RuntimeError(f"doxygen failed: {done.stderr}")
    prune(output / "xml")


def prune(folder: Path) -> None:
    """Takes out of the XML what Sphinx can't read or resolve.

    That are initializers with names, `{.name = "x"}`, and references to what no page describes.
    """
    pages = (TREE / "docs" / "reference" / "cpp").glob("*.md")
    names = [
        name
        for page in pages
        for name in re.findall(r"\{doxygen(?:class|struct)\} (\S+)", page.read_text("utf-8"))
    ]
    described = {
        f"{kind}{name.replace('_', '__').replace('::', '_1_1')}"
        for name in names
        for kind in ("class", "struct")
    }

    def reference(found: re.Match[str]) -> str:
        compound = re.sub(r"_1[a-z]?[0-9a-f]{30,}$", "", found.group(1))
        return found.group() if compound in described else found.group(2)

    for path in folder.glob("*.xml"):
        text = path.read_text("utf-8")
        text = re.sub(r'<ref refid="([^"]+)"[^>]*>(.*?)</ref>', reference, text)
        text = re.sub(r"\s*<(derived|base)compoundref [^>]*>.*?</\1compoundref>", "", text)
        text = re.sub(r"<initializer>=? ?\{\s*\..*?</initializer>", "", text, flags=re.DOTALL)
        text = re.sub(r"<defval>\{\s*\..*?</defval>", "<defval>{}</defval>", text, flags=re.DOTALL)
        text = re.sub(r"(<argsstring>.*?)=\s*\{\..*?\}", r"\1={}", text)
        path.write_text(text, "utf-8")


GENERATED: dict[str, Callable[[Sphinx], Iterator[str]]] = {
    "options of programs": options_of_programs,
    "commands of rtpm": commands_of_rtpm,
    "messages": messages,
    "gallery": gallery,
    "parts": parts,
}

# ---- Markdown as it is in the tree --------------------------------------------------------------

LINK = re.compile(r"\[([^\]]*)\]\(\s*([^)\s:#]+)((?:#[^)\s]*)?)\)")
PICTURE = re.compile(
    r'<picture>\s*<source [^>]*srcset="([^"]+)">\s*<img alt="([^"]*)" src="([^"]+)">\s*</picture>'
)


def rewrite(app: Sphinx, document: str, content: list[str]) -> None:
    folder = (TREE / app.env.doc2path(document, base=False)).parent

    def of_folder(link: re.Match[str]) -> str:
        text, target, anchor = link.groups()
        if not (folder / target).is_dir():
            return link.group()
        readme = target.rstrip("/") + "/README.md"
        # A folder without a README has no page; its name is told.
        return f"[{text}]({readme}{anchor})" if (folder / readme).exists() else text

    def of_name(line: re.Match[str]) -> str:
        return "\n".join(GENERATED[line.group(1)](app))

    text = LINK.sub(of_folder, content[0])
    text = PICTURE.sub(
        r"```{image} \3\n:class: only-light\n:alt: \2\n```\n\n"
        r"```{image} \1\n:class: only-dark\n:alt: \2\n```\n",
        text,
    )
    content[0] = re.sub(r"^<!-- generated: (.+) -->$", of_name, text, flags=re.MULTILINE)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_config_value("rtpm_programs", "", "env")
    app.add_transform(StatedAnchors)
    app.add_transform(ShortContents)
    app.add_lexer("fbs", ProtoBufLexer)
    app.add_lexer("hex", TextLexer)
    app.connect("config-inited", describe_headers)
    app.connect("source-read", rewrite)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
