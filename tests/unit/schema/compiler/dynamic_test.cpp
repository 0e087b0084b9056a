#include "rtpm/schema/dynamic.hpp"

#include <flatbuffers/flatbuffers.h>
#include <flatbuffers/reflection_generated.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "arm.rtpm.hpp"
#include "quantities.rtpm.hpp"
#include "rtpm/schema/schema_text.hpp"
#include "scratch_folder.hpp"

// A service's schema text, and payloads as JSON, against generated code of the same schema.
namespace rtpm::schema {
namespace {

namespace fs = std::filesystem;

std::unique_ptr<Dynamic> make(const rpc::InterfaceDescriptor& interface) {
  std::string error;
  auto dynamic = Dynamic::make(std::string(interface.schema), interface.name, error);
  EXPECT_TRUE(dynamic) << error;
  return dynamic;
}

/// Calls `visit` with the model of each schema of the goldens and of RTPM.
void for_each_model(const std::function<void(const Model&)>& visit) {
  for (const fs::path folder : {RTPM_GOLDEN_FOLDER, RTPM_IDL_FOLDER}) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() != ".fbs") continue;
      const CompileResult whole =
          compile({.file = entry.path().string(), .include_paths = {RTPM_IDL_FOLDER}});
      ASSERT_TRUE(whole.model) << render(whole.errors);
      visit(*whole.model);
    }
  }
}

// Equal fingerprints let a tool that compiles the text bind.
TEST(SchemaText, HasTheFingerprintsOfTheSchemaItComesFrom) {
  std::size_t count = 0;
  for_each_model([&](const Model& whole) {
    for (const Service& service : whole.services) {
      const std::string text = schema_text(whole, service);
      const CompileResult alone = compile_text(text, "schema");
      ASSERT_TRUE(alone.model) << render(alone.errors) << text;
      ASSERT_EQ(alone.model->services.size(), 1u);
      EXPECT_EQ(alone.model->services[0].fingerprint, service.fingerprint) << text;
      EXPECT_EQ(schema_text(*alone.model, alone.model->services[0]), text);
      ++count;
    }
  });
  EXPECT_GE(count, 9u);
}

// The fingerprint shows which version of the event a recording with the text has.
TEST(SchemaText, HasTheFingerprintAndRootOfAnEvent) {
  std::size_t count = 0;
  for_each_model([&](const Model& whole) {
    for (const Object& event : whole.objects) {
      if (!event.event_id) continue;
      const std::string text = schema_text(whole, event);
      const CompileResult alone = compile_text(text, "schema");
      ASSERT_TRUE(alone.model) << render(alone.errors) << text;
      const auto again = std::ranges::find(alone.model->objects, event.name, &Object::name);
      ASSERT_NE(again, alone.model->objects.end()) << text;
      EXPECT_EQ(again->event_id, event.event_id) << text;
      EXPECT_EQ(again->event_fingerprint, event.event_fingerprint) << text;
      test::expect_text(text, {"\nroot_type " + event.name + ";\n"});
      ++count;
    }
  });
  EXPECT_GE(count, 5u);
}

// A recording has a reflection only, from which a reader makes the schema.
TEST(CompileBinary, GivesTheFingerprintsOfTheSchemaItComesFrom) {
  std::size_t count = 0;
  for_each_model([&](const Model& whole) {
    for (const Object& object : whole.objects) {
      if (!object.event_id) continue;
      std::string error;
      const auto dynamic = Dynamic::make_for_event(schema_text(whole, object), object.name, error);
      ASSERT_TRUE(dynamic) << error;
      const auto whole_bytes = dynamic->reflection();
      const auto flat_bytes = dynamic->flat_reflection(object.name);
      for (const std::span<const std::byte> bytes :
           {whole_bytes, std::span<const std::byte>(flat_bytes)}) {
        const CompileResult read = compile_binary(
            {static_cast<const std::uint8_t*>(static_cast<const void*>(bytes.data())),
             bytes.size()},
            object.name);
        ASSERT_TRUE(read.model) << render(read.errors);
        const auto found = std::ranges::find(read.model->objects, object.name, &Object::name);
        ASSERT_NE(found, read.model->objects.end());
        EXPECT_EQ(found->event_fingerprint, object.event_fingerprint) << object.name;
        EXPECT_TRUE(compile_text(schema_text(*read.model), "schema").model);
      }
      ++count;
    }
  });
  EXPECT_GT(count, 0u);
}

TEST(CompileBinary, RefusesOtherBytes) {
  const std::vector<std::uint8_t> bytes(64, 7);
  EXPECT_FALSE(compile_binary(bytes, "schema").errors.empty());
  EXPECT_FALSE(compile_binary({}, "schema").errors.empty());
}

TEST(SchemaText, KeepsAttributesAndDefaults) {
  const Model model = test::model_of(R"(include "rtpm.fbs"; namespace lab;
    enum Mode : byte { Low = -3, High = 3 }
    table T { k:string (key); m:Mode = High; n:[ubyte] (nested_flatbuffer: "T"); f:float = -0.25; big:ulong = 18446744073709551615; b:bool = true; }
    /// A service.
    rpc_service S (rtpm_priority: 7) {
      a(T):rtpm.Empty (rtpm_id: 1, rtpm_oneway: "received");
      b(T):T (rtpm_id: 2, rtpm_stream, rtpm_max_size: 99);
      c(T):T (rtpm_id: 3, rtpm_deferred, rtpm_deadline_us: 5);
    })");
  const std::string text = schema_text(model, model.services.front());
  const CompileResult again = compile_text(text, "schema");
  ASSERT_TRUE(again.model) << render(again.errors) << text;
  const Service& service = again.model->services.front();
  EXPECT_EQ(service.fingerprint, model.services.front().fingerprint) << text;
  EXPECT_EQ(service.priority, 7);
  EXPECT_EQ(service.methods[0].oneway, OnewayLevel::kReceived);
  EXPECT_EQ(service.methods[1].max_size, 99u);
  EXPECT_TRUE(service.methods[2].is_deferred);
  EXPECT_EQ(service.methods[2].deadline_us, 5u);
  EXPECT_EQ(service.documentation, Documentation{" A service."});
}

TEST(Dynamic, WritesAStructAsGeneratedCodeReadsIt) {
  const auto arm = make(lab::ArmClient::interface());
  std::string error;
  const auto bytes = arm->encode(arm->find("set_force")->request,
                                 "{x_newton: 1, z_newton: -2.5, y_newton: 0}", error);
  ASSERT_TRUE(bytes) << error;
  ASSERT_EQ(bytes->size(), sizeof(lab::Force));
  lab::Force force;
  std::memcpy(&force, bytes->data(), sizeof force);
  EXPECT_EQ(force.x_newton(), 1);
  EXPECT_EQ(force.z_newton(), -2.5);
}

TEST(Dynamic, ReadsAStructAsGeneratedCodeWritesIt) {
  const auto arm = make(lab::ArmClient::interface());
  const lab::Position position(1, 2, -3.5);
  EXPECT_EQ(arm->decode(arm->find("get_position")->reply, rpc::struct_bytes(position)),
            "{\"x_m\": 1.0,\"y_m\": 2.0,\"z_m\": -3.5}");
}

TEST(Dynamic, WritesATableAsGeneratedCodeReadsIt) {
  const auto arm = make(lab::ArmClient::interface());
  std::string error;
  const auto bytes =
      arm->encode(arm->find("record")->request, "{title: \"take 1\", mode: Follow}", error);
  ASSERT_TRUE(bytes) << error;
  ASSERT_TRUE(rpc::is_valid_table<lab::RecordRequest>(*bytes));
  const auto& request = *flatbuffers::GetRoot<lab::RecordRequest>(bytes->data());
  EXPECT_EQ(request.title()->str(), "take 1");
  EXPECT_EQ(request.mode(), lab::Mode::Follow);
  EXPECT_EQ(request.rate_hz(), 1000);
}

TEST(Dynamic, ReadsATableAsGeneratedCodeWritesIt) {
  const auto arm = make(lab::ArmClient::interface());
  flatbuffers::FlatBufferBuilder builder;
  const std::vector<lab::Position> positions{lab::Position(1, 2, 3)};
  builder.Finish(lab::CreateRecordingDirect(builder, "take \"1\"", &positions));
  EXPECT_EQ(
      arm->decode(arm->find("replay")->reply, rpc::table_bytes(builder)),
      "{\"title\": \"take \\\"1\\\"\",\"positions\": [{\"x_m\": 1.0,\"y_m\": 2.0,\"z_m\": 3.0}]}");
}

TEST(Dynamic, EmptyPayloadsHaveNoBytes) {
  const auto arm = make(lab::ArmClient::interface());
  std::string error;
  const Method& release = *arm->find("release");
  EXPECT_EQ(arm->encode(release.request, "", error)->size(), 0u);
  EXPECT_EQ(arm->encode(release.request, "{}", error)->size(), 0u);
  EXPECT_FALSE(arm->encode(release.request, "{x: 1}", error));
  EXPECT_EQ(error, "the method takes nothing: leave the argument out");
  EXPECT_EQ(arm->decode(release.reply, {}), "{}");
}

TEST(Dynamic, MismatchesAreRefusedWithAReason) {
  const auto arm = make(lab::ArmClient::interface());
  const std::pair<const char*, const char*> wrong[] = {
      {"set_force", "{x_newton: 1}"}, {"set_force", "{colour: 1}"}, {"set_force", "nonsense"},
      {"record", "{title: 5}"},       {"record", "{mode: Fly}"},    {"record", "{title: \"a\""}};
  for (const auto& [method, json] : wrong) {
    std::string error;
    EXPECT_FALSE(arm->encode(arm->find(method)->request, json, error)) << json;
    EXPECT_NE(error, "") << json;
  }
  const std::vector<std::byte> bytes(25, std::byte{0xEE});
  EXPECT_FALSE(arm->decode(arm->find("get_position")->reply, bytes));
  EXPECT_FALSE(arm->decode(arm->find("replay")->reply, bytes));
  EXPECT_FALSE(arm->decode(arm->find("release")->reply, bytes));
  EXPECT_EQ(arm->find("fly"), nullptr);
}

TEST(Dynamic, LocatesMistakesInTheGivenText) {
  const auto arm = make(lab::ArmClient::interface());
  const std::pair<const char*, const char*> wrong[] = {{"record", "{title 5}"},
                                                       {"record", "{\n title 5}"},
                                                       {"set_force", "{x_newton 1}"},
                                                       {"set_force", "{\n x_newton 1}"}};
  for (const auto& [method, json] : wrong) {
    std::string error;
    EXPECT_FALSE(arm->encode(arm->find(method)->request, json, error)) << json;
    const bool has_two_lines = json[1] == '\n';
    EXPECT_TRUE(error.starts_with(has_two_lines ? "2: " : "1: ")) << json << ": " << error;
    EXPECT_LE(std::stoul(error.substr(3)), std::string_view(json).size()) << json << ": " << error;
  }
}

TEST(Dynamic, NamesTheFieldOfAMistake) {
  const auto scene = make(lab::quantities::SceneClient::interface());
  const auto error_of = [&](const char* method, const std::string& json) {
    std::string error;
    EXPECT_FALSE(scene->encode(scene->find(method)->request, json, error)) << json;
    return error;
  };
  const std::pair<const char*, const char*> wrong[] = {
      {"{unsigned_16: 65536}", ", in the field 'unsigned_16'"},
      {"{unsigned_16: 65536, maybe: 1}", ", in the field 'unsigned_16'"},
      {"{maybe: 1,\n \"unsigned_16\" : -1 // low\n}", ", in the field 'unsigned_16'"},
      {"{forces: [{x:1,y:1,z:1}, {x:1,y:\"high\",z:1}]}", ", in the field 'forces[1].y'"},
      {"{joints: {angle: [0,0,0], mode: 1}}", ", in the field 'joints.angle'"},
      {"{shape_type: Sphere, shape: {radius_m: \"wide\"}}", ", in the field 'shape.radius_m'"},
  };
  for (const auto& [json, words] : wrong) {
    const std::string error = error_of("echo", json);
    EXPECT_TRUE(error.ends_with(words)) << json << ": " << error;
  }
  const std::string unknown = error_of("echo", "{maybe: 1, colour: 2}");
  test::expect_text(unknown, {"colour"});
  EXPECT_EQ(unknown.find("maybe"), std::string::npos) << unknown;
}

TEST(Dynamic, NamesTheFieldsThatAStructLacks) {
  const auto arm = make(lab::ArmClient::interface());
  const auto scene = make(lab::quantities::SceneClient::interface());
  const auto error_of = [](Dynamic& dynamic, const char* method, const char* json) {
    std::string error;
    EXPECT_FALSE(dynamic.encode(dynamic.find(method)->request, json, error)) << json;
    return error;
  };
  const std::string why = ": the fields of a struct have no defaults";
  EXPECT_EQ(error_of(*arm, "set_force", "{x_newton: 1}"),
            "Force lacks y_newton and z_newton" + why);
  EXPECT_EQ(error_of(*arm, "set_force", ""), "Force lacks x_newton, y_newton and z_newton" + why);
  EXPECT_EQ(error_of(*scene, "echo", "{forces: [{x:1,y:1,z:1}, {z:1,x:1}]}"),
            "'forces[1]' lacks y" + why);
  EXPECT_EQ(error_of(*scene, "echo", "{joints: {mode: 1}}"), "'joints' lacks angle" + why);
}

// The schema's text, such as `rtpm info` prints, has a table around the struct.
TEST(Dynamic, AcceptsAStructInItsTable) {
  const auto arm = make(lab::ArmClient::interface());
  const Payload& payload = arm->find("set_force")->request;
  std::string error;
  const auto bare = arm->encode(payload, "{x_newton: 1, y_newton: 2, z_newton: 3}", error);
  ASSERT_TRUE(bare) << error;
  const std::string name = arm->model().objects[payload.table].fields.front().name;
  for (const std::string& field : {name, "\"" + name + "\" "}) {
    const std::string json = "{" + field + ": {x_newton: 1, y_newton: 2, z_newton: 3}}";
    EXPECT_EQ(arm->encode(payload, json, error), bare) << json << ": " << error;
  }
  EXPECT_FALSE(arm->encode(payload, "{" + name + ": {x_newton: 1}}", error));
  test::expect_text(error, {"'" + name + "' lacks y_newton and z_newton"});
}

TEST(Dynamic, PrintsNullForInfinityAndNan) {
  const auto arm = make(lab::ArmClient::interface());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const lab::Position position(-nan, -std::numeric_limits<double>::infinity(), 1);
  EXPECT_EQ(arm->decode(arm->find("get_position")->reply, rpc::struct_bytes(position)),
            "{\"x_m\": null,\"y_m\": null,\"z_m\": 1.0}");
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(lab::CreateRecordingDirect(builder, "\"nan, inf\\"));
  const auto text = arm->decode(arm->find("replay")->reply, rpc::table_bytes(builder));
  ASSERT_TRUE(text);
  test::expect_text(*text, {"\\\"nan, inf\\\\\""});
}

// The texts are nested deeper than any stack, and cut off at each place.
TEST(Dynamic, RefusesDeepAndTruncatedTexts) {
  const auto scene = make(lab::quantities::SceneClient::interface());
  const Payload& payload = scene->find("echo")->request;
  std::string error;
  for (const char* part : {"[", "{a:", "{forces:[", "/*", "{\"a"}) {
    std::string deep;
    for (int i = 0; i < 10'000; ++i)
      deep += part;
    EXPECT_FALSE(scene->encode(payload, deep, error)) << part;
  }
  const std::string whole = "{forces: [{x:1, y:1 /* N */, z:1}], \"maybe\": 'a\\'', // end\n}";
  for (std::size_t size = 1; size < whole.size(); ++size)
    EXPECT_FALSE(scene->encode(payload, whole.substr(0, size), error)) << whole.substr(0, size);
}

TEST(Dynamic, NumbersOutOfTheirRangeAreRefused) {
  const auto scene = make(lab::quantities::SceneClient::interface());
  const auto encode = [&](const char* method, const std::string& json) {
    std::string error;
    const auto bytes = scene->encode(scene->find(method)->request, json, error);
    EXPECT_EQ(bytes.has_value(), error.empty()) << json;
    return error;
  };
  EXPECT_EQ(encode("push", "{x: -20, y: 20, z: 0}"), "") << "both ends are within";
  EXPECT_EQ(encode("push", "{x: 0, y: 20.5, z: 0}"), "y is 20.5, but must be -20 to 20 newton");
  EXPECT_NE(encode("push", "{x: nan, y: 0, z: 0}"), "");
  EXPECT_EQ(encode("echo", "{unsigned_16: 1000}"), "");
  EXPECT_EQ(encode("echo", "{unsigned_16: 1001}"), "unsigned_16 is 1001, but must be 0 to 1000");
  EXPECT_EQ(encode("echo", "{forces: [{x:1,y:1,z:1}, {x:1,y:1,z:-21}]}"),
            "forces[1].z is -21, but must be -20 to 20 newton");
  EXPECT_EQ(encode("echo", "{joints: {angle: [0,0,0,0,0,4], mode: 1}}"),
            "joints.angle[5] is 4, but must be -3.2 to 3.2 radian");
  EXPECT_EQ(encode("echo", "{shape_type: Sphere, shape: {radius_m: 2}}"),
            "shape.radius_m is 2, but must be 0.001 to 1 metre");
  EXPECT_EQ(encode("echo", "{shape_type: Edge, shape: {x: 0, y: 0, z: 99}}"),
            "shape.z is 99, but must be -20 to 20 newton");
  EXPECT_EQ(encode("add",
                   "{name: \"a\", parts: [{name: \"b\", shape_type: Plane, shape: {normal: "
                   "{x: 21, y: 0, z: 0}}}]}"),
            "parts[0].shape.normal.x is 21, but must be -20 to 20 newton");
}

TEST(Dynamic, TextOtherThanASchemaIsRefused) {
  std::string error;
  EXPECT_EQ(Dynamic::make("table {", "lab.Arm", error), nullptr);
  EXPECT_TRUE(error.starts_with("schema:1:7: error: ")) << error;
  EXPECT_EQ(Dynamic::make(std::string(lab::ArmClient::interface().schema), "lab.Leg", error),
            nullptr);
  EXPECT_EQ(error, "the schema has no service lab.Leg");
}

TEST(Dynamic, ConvertsUnionsAndOptionalsBothWays) {
  const auto scene = make(lab::quantities::SceneClient::interface());
  std::string error;
  const std::string json =
      "{\"maybe\": 0,\"shape_type\": \"Sphere\",\"shape\": {\"radius_m\": 0.5}}";
  const Method& echo = *scene->find("echo");
  const auto bytes = scene->encode(echo.request, json, error);
  ASSERT_TRUE(bytes) << error;
  const auto text = scene->decode(echo.reply, *bytes);
  ASSERT_TRUE(text);
  test::expect_text(*text, {"\"maybe\": 0", "\"shape_type\": \"Sphere\"", "{\"radius_m\": 0.5}"});
}

TEST(Dynamic, ConvertsSumsOfFlagsBothWays) {
  const Model model = test::model_of(
      "include \"rtpm.fbs\"; enum Axes : ubyte (bit_flags) { X, Y, Z }\n"
      "table Move { axes:Axes; }\nrpc_service Arm { move(Move):Move (rtpm_id: 1); }\n");
  std::string error;
  const auto arm = Dynamic::make(schema_text(model, model.services.front()), "Arm", error);
  ASSERT_TRUE(arm) << error;
  const Payload& payload = arm->find("move")->request;
  const auto bytes = arm->encode(payload, "{axes: \"X Z\"}", error);
  ASSERT_TRUE(bytes) << error;
  EXPECT_EQ(arm->decode(payload, *bytes), "{\"axes\": \"X Z\"}");
}

// Tools that know only FlatBuffers use this format: the root is always the table.
TEST(DynamicTables, RoundTripToTheirPayloads) {
  std::size_t count = 0;
  const auto dynamic = make(lab::ArmClient::interface());
  ASSERT_TRUE(dynamic);
  const Payload& nothing = dynamic->find("release")->request;
  EXPECT_EQ(dynamic->from_table(nothing, {}), std::vector<std::byte>{});
  for (const Method& method : dynamic->service().methods) {
    for (const Payload& payload : {method.request, method.reply}) {
      std::string error;
      const auto bytes = dynamic->encode(payload, "{}", error);
      if (!bytes) continue;  // A table with a required field.
      const auto table = dynamic->as_table(payload, *bytes);
      ASSERT_TRUE(table) << method.name;
      EXPECT_EQ(dynamic->from_table(payload, *table), bytes) << method.name;
      EXPECT_FALSE(dynamic->from_table(payload, std::span(*table).first(5))) << method.name;
      ++count;
    }
  }
  EXPECT_GE(count, 4u);
}

TEST(DynamicTables, HaveTheirOwnReflection) {
  const auto dynamic = make(lab::ArmClient::interface());
  ASSERT_TRUE(dynamic);
  for (const Method& method : dynamic->service().methods) {
    for (const Payload& payload : {method.request, method.reply}) {
      const auto bytes = dynamic->reflection_of(payload);
      flatbuffers::Verifier verifier(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                     bytes.size());
      ASSERT_TRUE(reflection::VerifySchemaBuffer(verifier)) << method.name;
      const auto* schema = reflection::GetSchema(bytes.data());
      ASSERT_NE(schema->root_table(), nullptr) << method.name;
      EXPECT_EQ(schema->root_table()->name()->str(), dynamic->model().objects[payload.table].name);
      EXPECT_LE(bytes.size(), dynamic->reflection().size());
    }
  }
}

// The struct `Grid` has arrays of scalars, enums and structs, padding behind them, and a field with an
// element's name.
constexpr const char* kGridSchema = R"(
  namespace lab;
  enum Colour : ubyte { Red = 0, Blue = 1 }
  struct Point { x:double; y:float; }
  struct Grid { count_0:byte; counts:[ushort:3]; colours:[Colour:2]; corners:[Point:2]; count:[byte:1]; }
  table Gridded { grid:Grid (required); }
  root_type Gridded;)";

TEST(FlatReflection, HasTheSameBytesWithoutArrays) {
  std::string error;
  const auto dynamic = Dynamic::make(kGridSchema, error);
  ASSERT_TRUE(dynamic) << error;
  const auto bytes = dynamic->flat_reflection("lab.Gridded");
  const auto* const schema = reflection::GetSchema(bytes.data());
  const auto* const grid = schema->objects()->LookupByKey("lab.Grid");
  ASSERT_NE(grid, nullptr);
  const auto before = std::ranges::find(dynamic->model().objects, "lab.Grid", &Object::name);
  EXPECT_EQ(static_cast<std::size_t>(grid->bytesize()), before->byte_size);
  std::map<std::string, std::size_t> offsets;
  for (const auto* const field : *grid->fields()) {
    EXPECT_NE(field->type()->base_type(), reflection::Array) << field->name()->str();
    offsets[field->name()->str()] = field->offset();
  }
  EXPECT_EQ(offsets, (std::map<std::string, std::size_t>{{"count_0", 0},
                                                         {"counts_0", 2},
                                                         {"counts_1", 4},
                                                         {"counts_2", 6},
                                                         {"colours_0", 8},
                                                         {"colours_1", 9},
                                                         {"corners_0", 16},
                                                         {"corners_1", 32},
                                                         {"count_0_", 48}}));
}

TEST(FlatReflection, HasItsArraysForRtpm) {
  std::string error;
  const auto dynamic = Dynamic::make(kGridSchema, error);
  ASSERT_TRUE(dynamic) << error;
  const auto bytes = dynamic->flat_reflection("lab.Gridded");
  const auto read =
      compile_binary({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "grid");
  ASSERT_TRUE(read.model) << render(read.errors);
  EXPECT_EQ(schema_text(*read.model), schema_text(dynamic->model()));
}

}  // namespace
}  // namespace rtpm::schema
