#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>

#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/python_names.hpp"
#include "rtpm/schema/schema_text.hpp"
#include "scratch_folder.hpp"

// The text of a whole schema, and what is generated from it for Python beyond the goldens.
namespace rtpm::schema {
namespace {

namespace fs = std::filesystem;
using test::expect_text;
using test::ScratchFolder;

/// The fingerprints of a model's services, methods and events by name.
std::map<std::string, std::uint64_t> fingerprints_of(const Model& model) {
  std::map<std::string, std::uint64_t> result;
  for (const Service& service : model.services) {
    result[service.name] = service.fingerprint;
    for (const Method& method : service.methods)
      result[service.name + '/' + method.name] = method.fingerprint;
  }
  for (const Object& object : model.objects) {
    if (object.event_id) result[object.name] = object.event_fingerprint;
  }
  return result;
}

Model compiled(const std::string& file) {
  CompileResult result = compile({.file = file, .include_paths = {RTPM_IDL_FOLDER}});
  EXPECT_TRUE(result.model) << render(result.errors);
  return result.model ? *std::move(result.model) : Model{};
}

Model recompiled(const Model& model) {
  CompileResult result = compile_text(schema_text(model), model.file_stem);
  EXPECT_TRUE(result.model) << render(result.errors) << schema_text(model);
  return result.model ? *std::move(result.model) : Model{};
}

std::string stub_of(const Model& model) {
  const auto back_end = make_python_back_end("0.0.0");
  EXPECT_EQ(render(back_end->check(model)), "");
  return back_end->generate(model).at(1).text;
}

std::string errors_of(const std::string& text) {
  return render(make_python_back_end("0.0.0")->check(test::model_of(text)));
}

TEST(SchemaText, OfAWholeSchemaHasTheSameFingerprints) {
  std::size_t count = 0;
  for (const char* const folder : {RTPM_GOLDEN_FOLDER, RTPM_IDL_FOLDER}) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() != ".fbs") continue;
      const Model model = compiled(entry.path().string());
      const Model again = recompiled(model);
      EXPECT_EQ(fingerprints_of(again), fingerprints_of(model)) << entry.path();
      EXPECT_EQ(again.objects.size(), model.objects.size()) << entry.path();
      EXPECT_EQ(again.enums.size(), model.enums.size()) << entry.path();
      EXPECT_EQ(schema_text(again), schema_text(model)) << entry.path();
      count += fingerprints_of(model).size();
    }
  }
  EXPECT_GT(count, 50u);
}

constexpr const char* kFlags =
    "namespace lab;\n"
    "/// The axes.\nenum Axes : ulong (bit_flags) {\n  X,\n  /// up\n  Y,\n  Last = 63\n}\n"
    "enum Large : ulong { Least, Most = 18446744073709551615 }\n"
    "table Move { axes:Axes = \"X Y\"; large:Large; maybe:Axes = null; }\n";

TEST(SchemaText, KeepsFlagsAndLargeValues) {
  const Model model = test::model_of(kFlags);
  const Model again = recompiled(model);
  EXPECT_EQ(schema_text(again), schema_text(model));
  expect_text(schema_text(model),
              {"enum Axes : uint64 (bit_flags) {", "Last = 63,", "axes:lab.Axes = 3"});
}

TEST(PythonNames, EscapeWhatPythonReserves) {
  EXPECT_EQ(python_name("from"), "from_");
  EXPECT_EQ(python_name("None"), "None_");
  EXPECT_EQ(python_name("self"), "self_");
  EXPECT_EQ(python_name("mro"), "mro_");
  EXPECT_EQ(python_name("__init__"), "__init___");
  EXPECT_EQ(python_name("match"), "match");
  EXPECT_EQ(python_name("priority"), "priority");
  EXPECT_EQ(python_module_name("my-arm.2"), "my_arm_2_rtpm");
  EXPECT_EQ(python_module_name("2d"), "_2d_rtpm");
}

TEST(PythonStub, HasFlagsAndNotes) {
  expect_text(
      stub_of(test::model_of(kFlags)),
      {"import enum", "class Axes(enum.IntFlag):\n    \"\"\"The axes.\n\n    Y: up\n    \"\"\"\n",
       "    X = 1\n    Y = 2\n    Last = 9223372036854775808\n",
       "class Large(enum.IntEnum):\n    Least = 0\n    Most = 18446744073709551615\n",
       "    axes: Axes\n", "    maybe: Axes | None\n"});
}

TEST(PythonStub, EscapesNames) {
  expect_text(stub_of(test::model_of("include \"rtpm.fbs\";\nenum E : byte { None, mro }\n"
                                     "table T { from:E; self:int; }\n"
                                     "rpc_service S { import(T):rtpm.Empty (rtpm_id: 1); }\n")),
              {"    None_ = 0\n    mro_ = 1\n", "    from_: E\n    self_: int\n",
               "def __init__(self, *, from_: E = ..., self_: int = ...) -> None: ...",
               "    def import_(\n        self, request: T, /,"});
}

// In a class, a member hides the name of a type, a module or a built-in type.
TEST(PythonStub, NamesTypesThatMembersHide) {
  const std::string stub = stub_of(
      test::model_of("include \"rtpm.fbs\";\nenum Mode : byte { A }\ntable list { x:int; }\n"
                     "table Some { bytes:[ubyte]; Mode:[Mode]; many:[list]; str:[string]; }\n"
                     "table Reply { rtpm:[double]; }\n"
                     "rpc_service S { rtpm(rtpm.Empty):Reply (rtpm_id: 1, rtpm_stream); }\n"));
  expect_text(stub, {"from builtins import bytes as _bytes, list as _list, str as _str\n",
                     "import rtpm\nimport rtpm as _rtpm\n", "\nclass list(rtpm.Table):\n",
                     "    bytes: _bytes\n    Mode: _list[_Mode]\n    many: _list[list]\n"
                     "    str: _list[_str]\n",
                     "    rtpm: array.array[float]\n", " -> _rtpm.Stream[Reply]: ...",
                     "\n_Mode: TypeAlias = Mode\n"});
}

TEST(PythonStub, ImportsTypesOfIncludedFiles) {
  const ScratchFolder folder;
  folder.write("units.fbs", "namespace units; struct Vec { x:double; } struct Metre { x:double; }");
  folder.write("both.fbs", "include \"units.fbs\"; namespace both; struct Vec { x:float; }");
  const std::string file =
      folder.write("arm.fbs",
                   "include \"units.fbs\"; include \"both.fbs\"; namespace arm;\n"
                   "table Move { a:units.Vec; b:both.Vec; c:units.Metre; }\n");
  expect_text(stub_of(compiled(file)),
              {"\nfrom .both_rtpm import both_Vec as both_Vec\n"
               "from .units_rtpm import Metre as Metre\n"
               "from .units_rtpm import Vec as units_Vec\n\nclass Move(rtpm.Table):",
               "    a: units_Vec | None\n    b: both_Vec | None\n    c: Metre | None\n"});
  expect_text(stub_of(compiled((folder.path() / "both.fbs").string())),
              {"from .units_rtpm import Vec as units_Vec\n\nclass both_Vec(rtpm.Vector):"});
}

TEST(PythonStub, EscapesComments) {
  const std::string stub = stub_of(test::model_of(
      "/// \"quoted\" and \"\"\"thrice\"\"\", C:\\docs\\\ntable T { x:int; }\n/// ends with \"x\"\n"
      "struct S { x:int; }\n/// \xE9 is Latin-1\nstruct L { x:int; }\n"));
  expect_text(stub, {R"(""" "quoted" and ""\"thrice""\", C:\\docs\\""")", R"("""ends with "x" """)",
                     "\"\"\"\xEF\xBF\xBD is Latin-1\"\"\""});
}

TEST(PythonCheck, ReportsNamesThatClash) {
  expect_text(errors_of("table T { from:int; from_:int; }\n"),
              {"field `from_` becomes `from_` in Python, as field `from` does",
               "hint: rename one of the two"});
  expect_text(errors_of("enum E : byte { None, None_ }\n"), {"value `None_` becomes `None_`"});
  expect_text(
      errors_of("include \"rtpm.fbs\";\nrpc_service S { if(rtpm.Empty):rtpm.Empty (rtpm_id: 1);\n"
                "if_(rtpm.Empty):rtpm.Empty (rtpm_id: 2); }\n"),
      {"method `if_` becomes `if_` in Python, as method `if` does"});
  expect_text(errors_of("include \"rtpm.fbs\";\ntable ArmAsyncClient { x:int; }\n"
                        "rpc_service Arm { stop(rtpm.Empty):rtpm.Empty (rtpm_id: 1); }\n"),
              {"service `Arm` becomes `ArmAsyncClient` in Python, as table `ArmAsyncClient` does"});
  expect_text(errors_of("table T { x:int; y:int (deprecated); }\n/// \x01\nstruct S { x:int; }\n"),
              {"Python can't load the schema: a control character"});
}

}  // namespace
}  // namespace rtpm::schema
