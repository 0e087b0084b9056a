#include "rtpm/exports/scalars.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

#include "example_recording.hpp"
#include "rtpm/test/alloc_guard.hpp"

namespace rtpm::exports {
namespace {

/// A copy at the end of its own allocation, so that a sanitizer reports a read behind it.
class Exact {
 public:
  explicit Exact(ConstBytes bytes)
      : bytes_(std::make_unique<std::byte[]>(bytes.size())), size_(bytes.size()) {
    std::ranges::copy(bytes, bytes_.get());
  }
  [[nodiscard]] ConstBytes bytes() const { return {bytes_.get(), size_}; }
  [[nodiscard]] std::byte& operator[](std::size_t i) { return bytes_[i]; }

 private:
  std::unique_ptr<std::byte[]> bytes_;
  std::size_t size_;
};

class Scalars : public testing::Test {
 protected:
  static std::vector<std::byte> trial(const char* json) {
    std::string error;
    const auto dynamic = schema::Dynamic::make_for_event(test::kSchema, "lab.Trial", error);
    auto bytes = dynamic->encode(dynamic->event(), json, error);
    EXPECT_TRUE(bytes) << error;
    return *bytes;
  }
  static ScalarReader trials() {
    auto reader = ScalarReader::create(std::string(test::kSchema), "lab.Trial");
    EXPECT_TRUE(reader) << reader.error().text();
    return std::move(*reader);
  }
  static std::map<std::string, double> by_path(const ScalarReader& reader, ConstBytes message) {
    std::vector<double> values(reader.fields().size());
    EXPECT_TRUE(reader.read(Exact(message).bytes(), values));
    std::map<std::string, double> named;
    for (std::size_t i = 0; i < values.size(); ++i)
      named[reader.fields()[i].path] = values[i];
    return named;
  }
};

TEST_F(Scalars, ReadsEveryNumberOfAMessage) {
  const ScalarReader reader = trials();
  auto values = by_path(reader, trial(R"({"number":1,"phase":"Training","force":0.1,)"
                                      R"("pair":{"first":0.5,"numbers":[-1,2]},"seed":7,)"
                                      R"("samples":[1],"late":-7})"));
  EXPECT_EQ(values, (std::map<std::string, double>{{"number", 1},
                                                   {"phase", 0},
                                                   {"force", 0.1},
                                                   {"pair.first", 0.5},
                                                   {"pair.numbers[0]", -1},
                                                   {"pair.numbers[1]", 2},
                                                   {"seed", 7},
                                                   {"late", -7}}));
  values = by_path(reader, trial("{}"));
  EXPECT_EQ(values.at("number"), 0);
  EXPECT_EQ(values.at("phase"), 1) << "the schema's default is Test";
  EXPECT_TRUE(std::isnan(values.at("late"))) << "it has no default";
  EXPECT_TRUE(std::isnan(values.at("pair.first"))) << "a struct has none";
}

TEST_F(Scalars, HaveUnitsAndKinds) {
  const ScalarReader reader = trials();
  std::map<std::string, ScalarField> fields;
  for (const ScalarField& field : reader.fields())
    fields[field.path] = field;
  EXPECT_EQ(fields["force"].unit, "N");
  EXPECT_EQ(fields["number"].unit, "");
  EXPECT_EQ(fields["phase"].kind, ScalarField::Kind::kEnumeration);
  EXPECT_EQ(fields["number"].kind, ScalarField::Kind::kNumber);
}

TEST_F(Scalars, OfASampleHaveTheNamesAndUnitsOfTheDevicesParts) {
  const auto& event = device::SampledEvent::kDescriptor;
  const driver::Descriptor arm = test::arm();
  const auto reader = ScalarReader::create(std::string(event.schema), event.name, &arm);
  ASSERT_TRUE(reader) << reader.error().text();
  const device::Sample wire = gvd::to_wire(test::arm_sample(3));
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(device::CreateSampled(builder, &wire));
  const auto values =
      by_path(*reader, std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize())));
  EXPECT_EQ(values.at("position_m.y"), 1.0 / 3);
  EXPECT_EQ(values.at("joints.elbow"), 0.5);
  EXPECT_EQ(values.at("analogs.grip"), 7.5);
  EXPECT_EQ(values.at("sequence"), 3);
  EXPECT_FALSE(values.contains("joints[1]")) << "the arm has one joint";
  std::map<std::string, std::string> units;
  for (const ScalarField& field : reader->fields())
    units[field.path] = field.unit;
  EXPECT_EQ(units["position_m.y"], "m");
  EXPECT_EQ(units["linear_m_per_s.x"], "m/s");
  EXPECT_EQ(units["torque_newton_metre.x"], "N m");
  EXPECT_EQ(units["joints.elbow"], "rad");
  EXPECT_EQ(units["efforts.elbow"], "N m");
  EXPECT_EQ(units["orientation.x"], "");
}

TEST_F(Scalars, OfABareStructAreReadAsInEvents) {
  const auto& event = device::SampledEvent::kDescriptor;
  const auto reader = ScalarReader::create(std::string(event.schema), event.name, nullptr,
                                           ScalarReader::Form::kWire);
  ASSERT_TRUE(reader) << reader.error().text();
  const device::Sample wire = gvd::to_wire(test::arm_sample(3));
  const auto bytes = std::as_bytes(std::span(&wire, 1));
  EXPECT_EQ(by_path(*reader, bytes).at("position_m.z"), -2);
  std::vector<double> values(reader->fields().size());
  EXPECT_FALSE(reader->read(bytes.first(bytes.size() - 1), values));
}

TEST_F(Scalars, OfTablesInsideTablesAreAbsentWithTheirTable) {
  const auto reader = ScalarReader::create(
      "table Deep { a:int = 1; b:int; } table Inner { deep:Deep; c:short; } "
      "table Outer { first:Inner; second:Inner; last:bool; }",
      "Outer");
  ASSERT_TRUE(reader) << reader.error().text();
  std::string error;
  const auto dynamic = schema::Dynamic::make(
      "table Deep { a:int = 1; b:int; } table Inner { deep:Deep; c:short; } "
      "table Outer { first:Inner; second:Inner; last:bool; }",
      error);
  ASSERT_NE(dynamic, nullptr) << error;
  const auto& objects = dynamic->model().objects;
  const auto outer = std::ranges::find(objects, "Outer", &schema::Object::name);
  const auto bytes =
      dynamic->encode({.kind = schema::PayloadKind::kTable,
                       .table = static_cast<std::size_t>(outer - objects.begin())},
                      R"({"first":{"c":3},"second":{"deep":{"b":5},"c":4},"last":true})", error);
  ASSERT_TRUE(bytes) << error;
  const auto values = by_path(*reader, *bytes);
  EXPECT_TRUE(std::isnan(values.at("first.deep.a")));
  EXPECT_EQ(values.at("first.c"), 3);
  EXPECT_EQ(values.at("second.deep.a"), 1);
  EXPECT_EQ(values.at("second.deep.b"), 5);
  EXPECT_EQ(values.at("second.c"), 4);
  EXPECT_EQ(values.at("last"), 1);
}

TEST_F(Scalars, AreNanIfTheMessageIsDamaged) {
  const ScalarReader reader = trials();
  const auto whole = trial(R"({"number":1,"pair":{"first":0.5,"numbers":[-1,2]},"late":-7})");
  std::vector<double> values(reader.fields().size());
  for (const std::size_t size : {0U, 1U, 3U, 4U, 7U, 12U}) {
    EXPECT_FALSE(reader.read(Exact(ConstBytes(whole).first(size)).bytes(), values)) << size;
    EXPECT_TRUE(std::ranges::all_of(values, [](double value) { return std::isnan(value); }));
  }
  // No byte makes it read outside, which sanitizers would report.
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const int value : {0, 1, 0x7f, 0x80, 0xff}) {
      Exact damaged(whole);
      damaged[at] = static_cast<std::byte>(value);
      if (!reader.read(damaged.bytes(), values)) {
        EXPECT_TRUE(std::isnan(values.front()));
      }
    }
    static_cast<void>(reader.read(Exact(ConstBytes(whole).first(at)).bytes(), values));
  }
}

TEST_F(Scalars, AreReadWithoutAllocations) {
  if (!rtpm::test::is_alloc_guard_active()) GTEST_SKIP() << rtpm::test::kAllocGuardInactive;
  const ScalarReader reader = trials();
  const auto message = trial(R"({"number":1})");
  std::vector<double> values(reader.fields().size());
  const std::uint64_t before = rtpm::test::thread_allocation_count();
  EXPECT_TRUE(reader.read(message, values));
  EXPECT_EQ(rtpm::test::thread_allocation_count(), before);
}

TEST_F(Scalars, OfAForeignSchemaAreRefused) {
  EXPECT_FALSE(ScalarReader::create(std::string("table A { a:int; }"), "B"));
  EXPECT_FALSE(ScalarReader::create(std::string("tabel"), "A"));
  EXPECT_FALSE(ScalarReader::create({.name = "A", .encoding = "flatbuffer", .data = {}}));
  EXPECT_FALSE(ScalarReader::create({.name = "A", .encoding = "protobuf", .data = {}}));
  const auto many = ScalarReader::create(
      std::string("struct S { a:[double:5000]; } table A { s:S; t:int; }"), "A");
  ASSERT_FALSE(many);
  EXPECT_NE(many.error().text().find("4096"), std::string::npos) << many.error().text();
}

}  // namespace
}  // namespace rtpm::exports
