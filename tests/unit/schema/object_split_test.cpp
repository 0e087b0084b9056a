#include "cpp/object_split.hpp"

#include <gtest/gtest.h>

#include <string>

// What of flatc's header moves to a file that is compiled once. That both together are whole is
// shown by all code that is built from schemas.
namespace rtpm::schema {
namespace {

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
  const SplitHeader split =
      split_objects("namespace lab {\n" + kept + moved + "}  // namespace lab\n", "a_generated.h");
  EXPECT_EQ(split.header, "namespace lab {\n" + kept + "\n\n\n}  // namespace lab\n");
  EXPECT_EQ(split.header.find("UnPack"), std::string::npos);
  EXPECT_NE(split.source.find("#include \"a_generated.h\"\n"), std::string::npos);
  EXPECT_EQ(split.source.find("inline"), std::string::npos);
  EXPECT_EQ(split.source.find("CreateFoo("), std::string::npos);
  EXPECT_NE(split.source.find("namespace lab {\nFooT::FooT(const FooT &o)\n      : a(o.a) {\n}\n"),
            std::string::npos)
      << split.source;
  EXPECT_TRUE(split.source.ends_with("const {\n}\n\n}  // namespace lab\n")) << split.source;
}

}  // namespace
}  // namespace rtpm::schema
