#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "fixture.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/test/npm_peer.hpp"

// Another implementation of the protocol, @foxglove/ws-protocol from npm, beside rtpm-console.
namespace rtpm::system_test {
namespace {

class FoxglovePeer : public ConsoleSystem {
 protected:
  void SetUp() override {
    if (!test::install_peer()) {
      GTEST_SKIP() << "npm is not installed, or can't install @foxglove/ws-protocol";
    }
    ConsoleSystem::SetUp();
  }
  std::vector<Json> samples_{};
};

/// The recorded positions of each sequence number.
std::map<std::uint64_t, std::vector<double>> recorded_positions(const std::string& path) {
  std::map<std::uint64_t, std::vector<double>> positions;
  const auto reader = recording::FileReader::open(path);
  EXPECT_TRUE(reader) << reader.error().text();
  if (!reader) return positions;
  const auto read = (*reader)->read({}, [&](const recording::Message& message) {
    const std::string topic = (*reader)->channels().at(message.channel_id).topic;
    if (topic != "lab/arm0/sampled") return true;
    // The table's only field is the struct at its end: the root's vtable has its place.
    const auto* const data = message.data.data();
    const auto root = load_le<std::uint32_t>(data);
    const auto vtable = root - load_le<std::uint32_t>(data + root);
    const auto* const sample = data + root + load_le<std::uint16_t>(data + vtable + 4);
    std::vector<double> position;
    for (const std::size_t offset : {24U, 32U, 40U})
      position.push_back(std::bit_cast<double>(load_le<std::uint64_t>(sample + offset)));
    positions[load_le<std::uint64_t>(sample)] = position;
    return true;
  });
  EXPECT_TRUE(read) << read.error().text();
  return positions;
}

TEST_F(FoxglovePeer, SubscribesCallsAndSetsParameters) {
  const auto client = connect();
  ASSERT_TRUE(client->await_channel("lab/arm0/sample"));
  ASSERT_EQ(client->call("console/record_start", {{"file", "run.mcap"}}),
            Json({{"file", "run.mcap"}}));
  for (const std::string subprotocol : {"foxglove.sdk.v1", "foxglove.websocket.v1"}) {
    const Json seen =
        test::run_peer("session.mjs 'ws://127.0.0.1:" + std::to_string(console_->port) +
                       console_->target + "' " + subprotocol);
    ASSERT_TRUE(seen.is_object()) << seen;
    EXPECT_EQ(seen["info"]["name"], "rtpm-console");
    EXPECT_EQ(seen["described"]["serial"], "sim-arm0");
    EXPECT_EQ(seen["refused"], "there is no device 'lab/none' that answers");
    EXPECT_EQ(seen["values"]["get"][0]["name"], "lab/arm0.safety.ramp_s");
    EXPECT_EQ(seen["values"]["set"][0]["value"], 0.017);
    EXPECT_EQ(seen["values"]["update"][0]["value"], 0.017);
    EXPECT_EQ(seen["graph"], true);
    EXPECT_TRUE(seen["statuses"].empty()) << seen["statuses"];
    EXPECT_EQ(rtpm({"config", "set", "lab/arm0", "safety.ramp_s=0.01"}).exit_code, 0);
    samples_.insert(samples_.end(), seen["samples"].begin(), seen["samples"].end());
  }
  EXPECT_GT(client->call("console/record_stop", Json::object())["message_count"], 0);
  // The samples that the peer decoded are those that the devices published.
  const auto recorded = recorded_positions(folder_ + "/recordings/run.mcap");
  ASSERT_GE(samples_.size(), 10u);
  std::size_t found_count = 0;
  for (const Json& sample : samples_) {
    const auto found = recorded.find(sample["sequence"].get<std::uint64_t>());
    if (found == recorded.end()) continue;  // The latched one came before the recording.
    EXPECT_EQ(sample["position_m"].get<std::vector<double>>(), found->second);
    ++found_count;
  }
  EXPECT_GE(found_count, 8u);
}

}  // namespace
}  // namespace rtpm::system_test
