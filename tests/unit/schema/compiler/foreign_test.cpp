#include <flatbuffers/flatbuffers.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "reading/foreign_text.hpp"
#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/dynamic.hpp"
#include "scratch_folder.hpp"

// Schemas and payloads that other programs send: they open no file, and cost bounded time and
// memory.
namespace rtpm::schema {
namespace {

std::string refusal_of(const std::string& text) {
  const CompileResult result = compile_text(text, "schema");
  EXPECT_FALSE(result.model) << text.substr(0, 200);
  return render(result.errors);
}

std::string repeated(std::size_t count, const std::string& before, const std::string& after) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i)
    text += before + std::to_string(i) + after;
  return text;
}

TEST(ForeignSchema, OpensNoFile) {
  const test::ScratchFolder folder;
  const std::string file = folder.write("secret.fbs", "the_secret : x;\n");
  for (const char* const before : {"", "// \r", "/* */ ", "attribute \"a\"; ", "\xEF\xBB\xBF"}) {
    const std::string error =
        refusal_of(before + ("include \"" + file + "\";\n") + "table T { x:int; }\n");
    EXPECT_EQ(error.find("the_secret"), std::string::npos) << error;
    test::expect_text(error, {"of another program"});
  }
}

TEST(ForeignSchema, IsRefusedWithMoreThanDeclarations) {
  for (const char* const text :
       {"{ x: 1 }", "native_include \"a.h\";", "option a = 1;", "package a;", "message M { }",
        "table T { x:int = {}; }", "table T { x:[int] = [1]; }", "union U { a:int = 3 }",
        "table T { x:string = \"a\\u0000\"; }", "table T { x:int = 1abc; }", "service S { }",
        "enum E : int { A = B }", "table T { x:int (a: [1]); }", "table T {", ";", "table"}) {
    test::expect_text(refusal_of(text), {"schema of another program"});
  }
}

TEST(ForeignSchema, IsRefusedAboveItsLimits) {
  using Limits = ForeignLimits;
  const std::string values = repeated(Limits::kEnumValueMax + 1, "V", ",");
  const std::string fields = repeated(Limits::kMemberMax + 1, "f", ":int;");
  const std::string methods = repeated(Limits::kMethodMax + 1, "m", "(T):T;");
  for (const std::string& text :
       {"//" + std::string(Limits::kByteMax, ' '), "enum E : int {" + values + "}",
        "union U {" + values + "}", "table T {" + fields + "}",
        "table T {} rpc_service S {" + methods + "}",
        repeated(Limits::kStatementMax + 1, "table T", " {}"),
        repeated(Limits::kStatementMax + 1, "namespace n", ";"),
        "table " + std::string(Limits::kNameSizeMax + 1, 'T') + " {}",
        "namespace n" + repeated(Limits::kNamePartMax, ".n", "") + ";",
        "table T { x:int (a" + repeated(Limits::kAttributeMax, ", a", "") + "); }"}) {
    test::expect_text(refusal_of(text), {"a schema of another program has at most"});
  }
}

TEST(ForeignSchema, IsAcceptedAtItsLimits) {
  using Limits = ForeignLimits;
  const std::string text = "enum E : int {" + repeated(Limits::kEnumValueMax, "V", ",") + "}\n" +
                           "table T {" + repeated(4000, "f", ":int;") + "}\n" +
                           "attribute \"rtpm_id\"; rpc_service S {" +
                           [] {
                             std::string methods;
                             for (std::size_t i = 1; i <= Limits::kMethodMax; ++i) {
                               const std::string number = std::to_string(i);
                               methods += "m" + number + "(T):T (rtpm_id: " + number + ");";
                             }
                             return methods;
                           }() +
                           "}\n";
  ASSERT_LT(text.size(), Limits::kByteMax);
  std::string error;
  EXPECT_NE(Dynamic::make(text, "S", error), nullptr) << error;
}

TEST(ForeignSchema, IsRefusedWithStructsMoreThan64Deep) {
  const auto nested = [](int depth) {
    std::string text = "struct S1 { x:int; }\n";
    for (int i = 2; i <= depth; ++i) {
      text += "struct S" + std::to_string(i) + " { s:S" + std::to_string(i - 1) + "; }\n";
    }
    return text;
  };
  EXPECT_TRUE(compile_text(nested(64), "schema").model);
  test::expect_text(refusal_of(nested(65)), {"more than 64 deep"});
}

TEST(ForeignSchema, IsRefusedWithATooLargeStruct) {
  const std::string error =
      refusal_of("struct A { x:[double:65535]; }\nstruct B { a:[A:65535]; }\n");
  test::expect_text(error, {"struct `A` has 524280 bytes, and at most 65535 can be"});
}

constexpr const char* kTree =
    "attribute \"rtpm_id\";\n"
    "table Tree { words:[string]; children:[Tree]; nested:[ubyte] (nested_flatbuffer: \"Tree\"); "
    "flexible:[ubyte] (flexbuffer); }\n"
    "rpc_service Forest { plant(Tree):Tree (rtpm_id: 1); }\n";

std::vector<std::byte> finished(flatbuffers::FlatBufferBuilder& builder,
                                flatbuffers::uoffset_t tree) {
  builder.Finish(flatbuffers::Offset<flatbuffers::Table>(tree));
  const auto bytes = std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
  return {bytes.begin(), bytes.end()};
}

using Offsets = std::vector<flatbuffers::Offset<void>>;

// FlatBuffers would follow offsets in them that nothing verified.
TEST(ForeignPayload, ShowsNestedBuffersAsTheirBytes) {
  std::string error;
  const auto dynamic = Dynamic::make(kTree, "Forest", error);
  ASSERT_NE(dynamic, nullptr) << error;
  const Payload& payload = dynamic->find("plant")->reply;
  for (const flatbuffers::voffset_t slot : std::vector<flatbuffers::voffset_t>{8, 10}) {
    flatbuffers::FlatBufferBuilder builder;
    const auto nested = builder.CreateVector(std::vector<std::uint8_t>(4, 0xFF));
    const auto start = builder.StartTable();
    builder.AddOffset(slot, nested);
    const auto bytes = finished(builder, builder.EndTable(start));
    const auto text = dynamic->decode(payload, bytes);
    ASSERT_TRUE(text);
    test::expect_text(*text, {"[255,255,255,255]"});
    const auto again = dynamic->encode(payload, *text, error);
    ASSERT_TRUE(again) << error;
    EXPECT_EQ(dynamic->decode(payload, *again), text);
  }
}

// Every level refers to the level below twice: 2^30 tables in a few hundred bytes.
TEST(ForeignPayload, IsRefusedWithSharedTables) {
  std::string error;
  const auto dynamic = Dynamic::make(kTree, "Forest", error);
  ASSERT_NE(dynamic, nullptr) << error;
  flatbuffers::FlatBufferBuilder builder;
  flatbuffers::uoffset_t tree = builder.EndTable(builder.StartTable());
  for (int level = 0; level < 30; ++level) {
    const auto children = builder.CreateVector(Offsets(2, flatbuffers::Offset<void>(tree)));
    const auto start = builder.StartTable();
    builder.AddOffset(6, children);
    tree = builder.EndTable(start);
  }
  EXPECT_FALSE(dynamic->decode(dynamic->find("plant")->reply, finished(builder, tree)));
}

// 100 000 references to one text of 10 kB are a gigabyte of JSON.
TEST(ForeignPayload, IsRefusedAbove64MebibytesOfText) {
  std::string error;
  const auto dynamic = Dynamic::make(kTree, "Forest", error);
  ASSERT_NE(dynamic, nullptr) << error;
  for (const std::size_t count : {100u, 100'000u}) {
    flatbuffers::FlatBufferBuilder builder;
    const auto word = builder.CreateString(std::string(10'000, 'a'));
    const auto words = builder.CreateVector(Offsets(count, word.Union()));
    const auto start = builder.StartTable();
    builder.AddOffset(4, words);
    const auto bytes = finished(builder, builder.EndTable(start));
    EXPECT_EQ(dynamic->decode(dynamic->find("plant")->reply, bytes).has_value(), count == 100);
  }
}

}  // namespace
}  // namespace rtpm::schema
