#include "cpp/object_split.hpp"

#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include "rtpm/test/text.hpp"

// The functions of flatc's header that move to a source file. All code that is built from schemas
// shows that header and source file together are complete.
namespace rtpm::schema {
namespace {

/// `text` as flatc writes it since 23.1.
std::string with_global_names(std::string text) {
  constexpr std::string_view kName = " flatbuffers::";
  for (std::size_t at = 0; (at = text.find(kName, at)) != std::string::npos; at += kName.size())
    text.insert(at + 1, "::");
  return text;
}

TEST(ObjectSplit, MovesBodiesOfTheObjectApiOnly) {
  const std::string moved =
      "inline FooT::FooT(const FooT &o)\n      : a(o.a) {\n}\n\n"
      "inline FooT &FooT::operator=(FooT o) FLATBUFFERS_NOEXCEPT {\n  return *this;\n}\n\n"
      "inline FooT *Foo::UnPack(const flatbuffers::resolver_function_t *_resolver) const {\n"
      "  if (x) {\n  }\n}\n\n"
      "inline void Foo::UnPackTo(FooT *_o, const flatbuffers::resolver_function_t *_r) const "
      "{\n}\n";
  const std::string kept =
      "inline flatbuffers::Offset<Foo> CreateFoo(\n    flatbuffers::FlatBufferBuilder &_fbb) {\n}\n"
      "inline const char *EnumNameShape(Shape e) {\n}\n"
      "struct FooT : public flatbuffers::NativeTable {\n};\n";
  const std::string header = "namespace lab {\n" + kept + moved + "}  // namespace lab\n";
  const SplitHeader split = split_objects(header, "a_generated.h");
  const SplitHeader newer = split_objects(with_global_names(header), "a_generated.h");
  EXPECT_EQ(newer.header, with_global_names(split.header));
  EXPECT_EQ(newer.source, with_global_names(split.source));
  EXPECT_EQ(split.header, "namespace lab {\n" + kept + "\n\n\n}  // namespace lab\n");
  EXPECT_EQ(split.header.find("UnPack"), std::string::npos);
  rtpm::test::expect_text(split.source, {"#include \"a_generated.h\"\n"});
  EXPECT_EQ(split.source.find("inline"), std::string::npos);
  EXPECT_EQ(split.source.find("CreateFoo("), std::string::npos);
  rtpm::test::expect_text(split.source,
                          {"namespace lab {\nFooT::FooT(const FooT &o)\n      : a(o.a) {\n}\n"});
  EXPECT_TRUE(split.source.ends_with("const {\n}\n\n}  // namespace lab\n")) << split.source;
}

}  // namespace
}  // namespace rtpm::schema
