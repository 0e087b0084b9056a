// The worked payloads of spec/payloads.md, read from that page: RTPM's generated code writes and
// reads exactly these bytes, and the page's tables describe each of them. So it does with the structs
// whose bytes spec/idl/services.json states.

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "device_generated.h"
#include "names_generated.h"

namespace rtpm::spec {
namespace {

using Octets = std::vector<std::uint8_t>;

Octets octets_of(const std::string& text) {
  Octets octets;
  std::istringstream words(text);
  for (unsigned value = 0; words >> std::hex >> value;)
    octets.push_back(static_cast<std::uint8_t>(value));
  return octets;
}

/// The page's text of one payload: its block of bytes, and the rows of the table behind it.
struct Example {
  Octets block;
  Octets in_rows;
  std::vector<std::size_t> offsets;  ///< The offsets that the rows state.
  std::vector<std::size_t> begins;   ///< The rows' real offsets.
};

Example example(const std::string& name) {
  static const std::regex kRow(R"(^\| ([0-9]+) \| `([0-9a-f ]+)` \| .*)");
  std::ifstream page(RTPM_SPEC_DIR "/payloads.md");
  Example found;
  bool is_block = false;
  bool is_table = false;
  for (std::string line; std::getline(page, line);) {
    std::smatch row;
    if (line.starts_with("```hex ")) {
      is_block = is_table = line == "```hex " + name;
    } else if (line == "```") {
      is_block = false;
    } else if (is_block) {
      const Octets more = octets_of(line);
      found.block.insert(found.block.end(), more.begin(), more.end());
    } else if (is_table && std::regex_match(line, row, kRow)) {
      found.offsets.push_back(std::stoul(row[1]));
      found.begins.push_back(found.in_rows.size());
      const Octets more = octets_of(row[2]);
      found.in_rows.insert(found.in_rows.end(), more.begin(), more.end());
    }
  }
  return found;
}

Octets finished(flatbuffers::FlatBufferBuilder& builder) {
  return {builder.GetBufferPointer(), builder.GetBufferPointer() + builder.GetSize()};
}

/// The root table of type T; null if the bytes are invalid.
template <class T>
const T* root_of(const Octets& octets) {
  flatbuffers::Verifier verifier(octets.data(), octets.size());
  return verifier.VerifyBuffer<T>() ? flatbuffers::GetRoot<T>(octets.data()) : nullptr;
}

TEST(PayloadExamples, RowsDescribeEachByte) {
  for (const char* name : {"resolve-request", "resolve-reply", "device-command"}) {
    const Example page = example(name);
    EXPECT_FALSE(page.block.empty()) << name;
    EXPECT_EQ(page.in_rows, page.block) << name;
    EXPECT_EQ(page.offsets, page.begins) << name;
  }
}

// hp-12-3
TEST(PayloadExamples, ResolveRequest) {
  const Octets octets = example("resolve-request").block;
  const auto* request = root_of<names::ResolveRequest>(octets);
  ASSERT_NE(request, nullptr);
  EXPECT_EQ(request->name()->str(), "lab/arm0");
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(names::CreateResolveRequest(builder, builder.CreateString("lab/arm0")));
  EXPECT_EQ(finished(builder), octets);
}

TEST(PayloadExamples, ResolveReply) {
  const Octets octets = example("resolve-reply").block;
  const auto* reply = root_of<names::ResolveReply>(octets);
  ASSERT_NE(reply, nullptr);
  EXPECT_EQ(reply->answer()->outcome(), names::OutcomeCode::Done);
  EXPECT_EQ(reply->answer()->component(), 0);
  ASSERT_NE(reply->entry(), nullptr);
  EXPECT_EQ(reply->entry()->name()->str(), "lab/arm0");
  EXPECT_EQ(reply->entry()->url()->str(), "rtpm://192.168.0.7:7421/lab/arm0");
  EXPECT_EQ(reply->entry()->interface()->str(), "rtpm.device.Device");
  EXPECT_EQ(reply->entry()->lease_left_ns(), 2'500'000'000U);
  flatbuffers::FlatBufferBuilder builder;
  const auto entry =
      names::CreateEntryDirect(builder, "lab/arm0", "rtpm://192.168.0.7:7421/lab/arm0",
                               "rtpm.device.Device", 2'500'000'000U);
  const names::Answer answer(names::OutcomeCode::Done, 0);
  builder.Finish(names::CreateResolveReply(builder, &answer, entry));
  EXPECT_EQ(finished(builder), octets);
}

// hp-12-2
TEST(PayloadExamples, DeviceCommand) {
  const Octets octets = example("device-command").block;
  ASSERT_EQ(octets.size(), sizeof(device::Command));
  const auto* command = reinterpret_cast<const device::Command*>(octets.data());
  EXPECT_EQ(command->force_newton().x(), 1.5);
  EXPECT_EQ(command->force_newton().z(), -0.25);
  EXPECT_EQ(command->torque_newton_metre().z(), 0.125);
  EXPECT_EQ(command->lease(), 0x1122334455667788U);
  EXPECT_EQ(command->sequence(), 7U);
  EXPECT_EQ(command->hold_us(), 20'000U);
  EXPECT_EQ(command->mode(), device::CommandMode::Force);
  const device::Vector3 zero(0, 0, 0);
  const device::Command same({1.5, 0, -0.25}, {0, 0, 0.125}, zero, {0, 0, 0, 1}, zero, zero,
                             std::array<double, 8>{}, std::array<float, 8>{}, 0x1122334455667788, 7,
                             20'000, device::CommandMode::Force);
  EXPECT_EQ(std::memcmp(&same, octets.data(), sizeof same), 0);
}

/// A struct as spec/idl/services.json publishes it.
class PublishedStruct {
 public:
  explicit PublishedStruct(const std::string& name) {
    std::ifstream file(RTPM_SPEC_DIR "/idl/services.json");
    const nlohmann::json all = nlohmann::json::parse(file);
    for (const auto& one : all.at("structs"))
      if (one.at("struct") == name) layout_ = one;
  }
  [[nodiscard]] std::size_t size() const { return layout_.value("size", std::size_t{0}); }
  /// The field's offset; fails the test, and gives 0, for an unknown field.
  [[nodiscard]] std::size_t offset(const std::string& field) const {
    for (const auto& one : layout_.at("fields"))
      if (one.at("name") == field) return one.at("offset");
    ADD_FAILURE() << "services.json has no " << field;
    return 0;
  }
  [[nodiscard]] const nlohmann::json& fields() const { return layout_.at("fields"); }

 private:
  nlohmann::json layout_;
};

template <class T>
void put(Octets& octets, std::size_t offset, T value) {
  ASSERT_LE(offset + sizeof value, octets.size());
  std::memcpy(octets.data() + offset, &value, sizeof value);
}

TEST(PublishedStructs, HaveTheBytesOfOurCode) {
  const PublishedStruct sample("rtpm.device.Sample");
  const PublishedStruct vector("rtpm.device.Vector3");
  ASSERT_EQ(sample.size(), sizeof(device::Sample));
  ASSERT_EQ(vector.size(), sizeof(device::Vector3));
  Octets octets(sample.size());
  put(octets, sample.offset("sequence"), std::uint64_t{7});
  put(octets, sample.offset("force_newton") + vector.offset("y"), 1.5);
  put(octets, sample.offset("joints") + 7 * sizeof(double), -2.5);
  put(octets, sample.offset("button_edges") + 15 * sizeof(std::uint16_t), std::uint16_t{9});
  put(octets, sample.offset("success_rate"), 0.75F);
  put(octets, sample.offset("lifecycle"), std::uint8_t{3});
  const auto* read = reinterpret_cast<const device::Sample*>(octets.data());
  EXPECT_EQ(read->sequence(), 7U);
  EXPECT_EQ(read->force_newton().y(), 1.5);
  EXPECT_EQ(read->joints()->Get(7), -2.5);
  EXPECT_EQ(read->button_edges()->Get(15), 9U);
  EXPECT_EQ(read->success_rate(), 0.75F);
  EXPECT_EQ(static_cast<int>(read->lifecycle()), 3);
  EXPECT_EQ(PublishedStruct("rtpm.names.OwnerId").size(), sizeof(names::OwnerId));
}

TEST(PublishedStructs, HaveFieldsOneBehindTheOther) {
  for (const char* name : {"rtpm.device.Sample", "rtpm.device.Command", "rtpm.device.Lease"}) {
    const PublishedStruct one(name);
    std::size_t end = 0;
    for (const auto& field : one.fields()) {
      EXPECT_GE(field.at("offset").get<std::size_t>(), end) << name << field;
      end = field.at("offset").get<std::size_t>() + field.at("size").get<std::size_t>();
    }
    EXPECT_GT(end, 0U);
    EXPECT_LE(end, one.size());
  }
}

}  // namespace
}  // namespace rtpm::spec
