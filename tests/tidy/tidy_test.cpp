#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "expect_fault.hpp"
#include "include_graph.hpp"
#include "source_rules.hpp"
#include "source_tree.hpp"
#include "vocabulary.hpp"

// The rules of CONTRIBUTING.md that a machine can check. Each check has two tests: the tree obeys,
// and a planted breach is found, so that a check that went blind shows.
namespace rtpm::tidy {
namespace {

const std::vector<SourceFile>& tree() {
  static const std::vector<SourceFile> kTree = read_tree(RTPM_SOURCE_FOLDER);
  return kTree;
}

TEST(SourceTree, IsRead) {
  ASSERT_GT(tree().size(), 20u);
  bool has_this_file = false;
  for (const SourceFile& file : tree()) {
    has_this_file = has_this_file || file.path == "tests/tidy/tidy_test.cpp";
  }
  EXPECT_TRUE(has_this_file);
}

TEST(SourceTree, CodeIsTextWithoutCommentsAndLiterals) {
  EXPECT_EQ(code_of("int a; // throw\nint b;"), "int a;         \nint b;");
  EXPECT_EQ(code_of("f(\"throw\\\" x\"); /* a\nb */ g();"), "f(\"         \");     \n     g();");
  EXPECT_EQ(code_of("auto c = '\"'; int d = 1'000; e(\"\");"),
            "auto c = ' '; int d = 1'000; e(\"\");");
  EXPECT_EQ(code_of("x(R\"t(a\"b)t\"); y();").substr(14), " y();");
}

TEST(IncludeGraph, PointsOnlyDown) {
  expect_no_fault(find_forbidden_includes(tree()));
}

TEST(IncludeGraph, FindsAPlantedIncludeThatPointsUp) {
  const std::vector<SourceFile> planted{
      {"protocol/wire/src/codec.cpp", "#include <vector>\n#include \"rtpm/rpc/server.hpp\"\n"},
      {"runtime/rt/src/clock.cpp", "#include \"rtpm/wire/header.hpp\"\n"},
      {"gvd/driver/include/rtpm/driver/a.hpp", "#include \"rtpm/rt/clock.hpp\"\n"},
      {"registry/names/src/a.cpp", "#include <rtpm/gvd/server.hpp>\n"},
      {"schema/compiler/src/a.cpp", "#include \"rtpm/base/bytes.hpp\"\n"},
  };
  const auto faults = find_forbidden_includes(planted);
  EXPECT_EQ(faults.size(), planted.size());
  expect_fault(faults, "protocol/wire/src/codec.cpp:2:", "includes rtpm/rpc/server.hpp");
  expect_fault(faults, "runtime/rt/src/clock.cpp:1:", "it may include: rt, base");
  expect_fault(faults, "gvd/driver/", "not below gvd/driver/");
  expect_fault(faults, "registry/names/", "rtpm/gvd/server.hpp");
  expect_fault(faults, "schema/", "rtpm/base/bytes.hpp");
}

TEST(IncludeGraph, AcceptsIncludesThatPointDown) {
  expect_no_fault(find_forbidden_includes({
      {"runtime/rpc/src/a.cpp", "#include \"a.hpp\"\n#include \"rtpm/wire/header.hpp\"\n"},
      {"runtime/rpc/src/a.hpp", "#include <flatbuffers/flatbuffers.h>\n"},
      {"runtime/rt/src/os/posix/thread.cpp",
       "#include <pthread.h>\n#include \"rtpm/base/time.hpp\"\n"},
      {"tests/unit/rpc/a_test.cpp", "#include <gtest/gtest.h>\n#include \"rtpm/rpc/node.hpp\"\n"},
  }));
}

TEST(IncludeGraph, FindsPlantedForeignAndPrivateHeaders) {
  const auto faults = find_forbidden_includes({
      {"runtime/transport/src/a.cpp", "#include <flatbuffers/flatbuffers.h>\n"},
      {"gvd/driver/src/a.cpp", "#include <Eigen/Core>\n"},
      {"registry/names/src/a.cpp", "#include <sys/socket.h>\n"},
      {"runtime/rt/src/thread.cpp", "#include <pthread.h>\n"},
      {"runtime/rpc/src/a.cpp", "#include \"socket_impl.hpp\"\n"},
      {"runtime/transport/src/socket_impl.hpp", ""},
      {"elsewhere/a.cpp", ""},
  });
  EXPECT_EQ(faults.size(), 6u);
  expect_fault(faults, "runtime/rt/src/thread.cpp:1:", "the operating system is not for");
  expect_fault(faults, "runtime/transport/src/a.cpp:1:", "FlatBuffers is not for");
  expect_fault(faults, "gvd/driver/src/a.cpp:1:", "Eigen is not for");
  expect_fault(faults, "registry/names/src/a.cpp:1:", "the operating system is not for");
  expect_fault(faults, "runtime/rpc/src/a.cpp:1:", "no header of runtime/rpc/");
  expect_fault(faults, "elsewhere/a.cpp:", "in no part of the house");
}

TEST(IncludeGraph, FindsPlantedIncludesAgainstTheOrderInsideAPart) {
  const auto faults = find_forbidden_includes({
      {"runtime/rpc/src/calls/a.cpp", "#include \"lane/lane.hpp\"\n#include \"calls/a.hpp\"\n"},
      {"runtime/rpc/src/calls/a.hpp", "#include \"model/b.hpp\"\n"},
      {"runtime/rpc/src/lane/lane.hpp", ""},
      {"runtime/rpc/src/model/b.hpp", "#include \"c.hpp\"\n"},
      {"runtime/rpc/src/c.hpp", ""},
      {"runtime/rpc/src/attic/d.cpp", "#include \"model/b.hpp\"\n"},
  });
  EXPECT_EQ(faults.size(), 2u);
  expect_fault(faults, "runtime/rpc/src/calls/a.cpp:1:", "above runtime/rpc/src/calls");
  expect_fault(faults, "runtime/rpc/src/attic/d.cpp:1:", "without a place in its order");
}

TEST(BannedWords, AreAbsentFromTheTree) {
  expect_no_fault(find_banned_words(tree(), exemptions()));
}

TEST(BannedWords, AreFoundWherePlanted) {
  const std::vector<SourceFile> planted{
      {"runtime/rpc/src/a.cpp", "#include <mutex>\nstd::mutex guard;\n"},
      {"protocol/wire/src/a.cpp", "void f() { throw 1; }\n"},
      {"runtime/rt/src/a.cpp", "void f() { std::this_thread::sleep_for(x); printf(\"x\"); }\n"},
      {"clients/servo/a.cpp", "auto t = std::chrono::system_clock::now();\n"},
      {"clients/servo/main.cpp", "std::fprintf(stderr, name);\n"},
      {"runtime/access/src/a.cpp", "#if defined(__linux__)\n#endif\n"},
      {"runtime/access/src/b.cpp", "#include <windows.h>\n"},
      {"protocol/wire/src/b.cpp", "int a = __builtin_popcount(3);\n"},
      {"gvd/driver/src/a.cpp", "auto t = std::chrono::steady_clock::now();\n"},
      {"spec/a.md", std::string("one\n\nTO") + "DO: say more\n"},
      {"README.md", std::string("see /ho") + "me/somebody/rtpm\n"},
      {"runtime/rpc/src/b.hpp", "std::function<void()> f;\n"},
  };
  const auto faults = find_banned_words(planted, {});
  expect_fault(faults, "runtime/rpc/src/a.cpp:2:", "rule mutex");
  expect_fault(faults, "protocol/wire/src/a.cpp:1:", "rule throw");
  expect_fault(faults, "runtime/rt/src/a.cpp:1:", "rule sleep");
  expect_fault(faults, "runtime/rt/src/a.cpp:1:", "rule print");
  expect_fault(faults, "clients/servo/a.cpp:1:", "rule wall-clock");
  expect_fault(faults, "gvd/driver/src/a.cpp:1:", "rule clock");
  expect_fault(faults, "spec/a.md:3:", "rule deferred");
  expect_fault(faults, "README.md:1:", "rule machine-path");
  expect_fault(faults, "runtime/rpc/src/b.hpp:1:", "rule function");
  expect_fault(faults, "clients/servo/main.cpp:1:", "rule stderr");
  expect_fault(faults, "runtime/access/src/a.cpp:1:", "rule system");
  expect_fault(faults, "runtime/access/src/b.cpp:1:", "rule system");
  expect_fault(faults, "protocol/wire/src/b.cpp:1:", "rule compiler");
  EXPECT_EQ(faults.size(), 13u);
}

TEST(BannedWords, AreAllowedInCommentsTextsAndOtherFolders) {
  expect_no_fault(
      find_banned_words({{"runtime/rpc/src/a.cpp", "// never std::mutex, never throw\n"},
                         {"runtime/rpc/src/b.cpp", "auto a = \"printf\";\n"},
                         {"runtime/rt/src/os/linux/a.cpp", "#ifdef __linux__\n#endif\n"},
                         {"clients/servo/a.cpp", "std::mutex guard; printf(\"x\");\n"}},
                        {}));
}

TEST(BannedWords, ExemptionCoversItsFileAndExpires) {
  const std::vector<Exemption> excused{{"print", "protocol/base/src/a.cpp", "a reason"}};
  expect_no_fault(find_banned_words({{"protocol/base/src/a.cpp", "printf(\"x\");\n"}}, excused));
  expect_fault(find_banned_words({{"protocol/base/src/a.cpp", "\n"}}, excused),
               "protocol/base/src/a.cpp", "take the exemption away");
}

TEST(Vocabulary, IsFollowedByTheTree) {
  expect_no_fault(find_home_made_words(tree()));
}

TEST(Vocabulary, FindsHomeMadeWordsInCodeAndFileNames) {
  const auto faults =
      find_home_made_words({{"runtime/rpc/src/crew_test.cpp", "\n"},
                            {"runtime/rt/src/a.cpp", "int x;\nint kNapMax = 1;\n"},
                            {"runtime/rt/src/b.hpp", "bool has_wishes() const;\n"},
                            {"clients/a.cpp", "class FrameTrain;\n"},
                            {"clients/b.cpp", "int late_tables; int LookAround;\n"}});
  expect_fault(faults, "runtime/rpc/src/crew_test.cpp:1:", "write: thread pool");
  expect_fault(faults, "runtime/rt/src/a.cpp:2:", "'kNapMax': 'nap' is not the field's word");
  expect_fault(faults, "runtime/rt/src/b.hpp:1:", "write: interest");
  expect_fault(faults, "clients/a.cpp:1:", "write: datagram batch");
  expect_fault(faults, "clients/b.cpp:1:", "write: deferred reply");
  expect_fault(faults, "clients/b.cpp:1:", "write: poll");
  EXPECT_EQ(faults.size(), 6u);
}

TEST(Vocabulary, IsNotReadInCommentsAndTexts) {
  expect_no_fault(find_home_made_words(
      {{"runtime/rt/src/a.cpp",
        "// a train of words\nauto a = \"crew\"; int bone; RepairWish w;\n"}}));
}

TEST(Comments, BeginWithTheirSubject) {
  expect_no_fault(find_comments_without_subject(tree()));
}

TEST(Comments, AreFoundWithoutASubject) {
  const auto faults = find_comments_without_subject(
      {{"a.hpp", "/// What a lane is.\nint x;  ///< Of the lane.\n// It is. Who calls, waits.\n"},
       {"b.cpp", "/// @param x  So many are kept.\n"},
       {"d.ts", "/** What it is. */\n/**\n * A part.\n * Of it.\n */\n"},
       {"c.cpp", "// A part\n// Of what it has.\nauto a = \"// What\";\n// As http://a.b/What\n"}});
  expect_fault(faults, "a.hpp:1:", "'What'");
  expect_fault(faults, "a.hpp:2:", "'Of'");
  expect_fault(faults, "a.hpp:3:", "'Who'");
  expect_fault(faults, "b.cpp:1:", "subject, verb, object");
  expect_fault(faults, "d.ts:1:", "'What'");
  expect_fault(faults, "d.ts:4:", "'Of'");
  EXPECT_EQ(faults.size(), 6u);
}

TEST(Files, AreInShape) {
  expect_no_fault(find_misshapen_files(tree()));
}

TEST(Files, AreFoundIfMisshapen) {
  std::string long_text = "#pragma once\n";
  for (int i = 0; i < 800; ++i)
    long_text += "//\n";
  const auto faults = find_misshapen_files({
      {"CMakeLists.txt", "add_subdirectory(runtime)"},
      {"runtime/CMakeLists.txt", "add_subdirectory(rt)"},
      {"runtime/rpc/CMakeLists.txt", ""},
      {"runtime/rt/CMakeLists.txt",
       "rtpm_library(NAME rt SOURCES src/named.cpp src/${by}_variable.cpp)"},
      {"runtime/rt/src/named_by_variable.cpp", ""},
      {"runtime/rt/src/named.cpp", ""},
      {"runtime/rt/src/orphan.cpp", ""},
      {"runtime/rt/src/bare.hpp", "int a;\n"},
      {"runtime/rt/src/greedy.hpp", "#pragma once\nusing namespace std;\n"},
      {"runtime/rt/src/long.hpp", long_text},
  });
  EXPECT_EQ(faults.size(), 5u);
  expect_fault(faults, "runtime/rpc/CMakeLists.txt:1:", "no CMakeLists.txt above");
  expect_fault(faults, "runtime/rt/src/orphan.cpp:1:", "no CMakeLists.txt");
  expect_fault(faults, "runtime/rt/src/bare.hpp:1:", "#pragma once");
  expect_fault(faults, "runtime/rt/src/greedy.hpp:2:", "using namespace");
  expect_fault(faults, "runtime/rt/src/long.hpp:801:", "800 lines");
}

TEST(Tests, AllAssertSomething) {
  expect_no_fault(find_empty_tests(tree()));
}

TEST(Tests, AreFoundIfTheyAssertNothing) {
  // In a text of its own, so that this file's own tests are not mistaken for it.
  const std::string planted =
      "TEST(A, Good) { if (x) { EXPECT_TRUE(y); } }\n"
      "TEST(A, Empty) { run(); }\n"
      "TEST_F(B, Delegates) { expect_refusal(run()); }\n"
      "TEST_P(B, OnlySkips) { GTEST_SKIP() << \"EXPECT_TRUE(no)\"; }\n";
  const auto faults = find_empty_tests({{"tests/unit/a_test.cpp", planted}});
  EXPECT_EQ(faults.size(), 2u);
  expect_fault(faults, "tests/unit/a_test.cpp:2:", "asserts nothing");
  expect_fault(faults, "tests/unit/a_test.cpp:4:", "asserts nothing");
}

}  // namespace
}  // namespace rtpm::tidy
