#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "programs.hpp"
#include "web_client.hpp"

namespace rtpm::system_test {

using Json = nlohmann::json;

/// A running rtpm-console.
struct ConsoleProcess {
  test::Process process;
  std::uint16_t port = 0;
  std::string target{};  ///< "/?token=…", from its URL.
};

/// Starts rtpm-console and waits until it serves. If that fails, the test fails, and so must its
/// caller.
[[nodiscard]] std::optional<ConsoleProcess> start_console(std::vector<std::string> arguments);

/// A client that knows the channels and services that the console advertises.
/// @threads  one
class ConsoleClient {
 public:
  ConsoleClient(std::uint16_t port, const std::string& target) : web_(port, {.target = target}) {}

  struct Message {
    std::string topic{};
    std::uint64_t log_time_ns = 0;
    std::string payload{};
    [[nodiscard]] Json json() const { return Json::parse(payload, nullptr, false); }
  };

  [[nodiscard]] WebClient& web() noexcept { return web_; }
  [[nodiscard]] const Json& info() const noexcept { return info_; }
  [[nodiscard]] const std::map<std::string, Json>& channels() const noexcept { return channels_; }
  [[nodiscard]] const std::map<std::string, Json>& services() const noexcept { return services_; }
  [[nodiscard]] const std::vector<Json>& statuses() const noexcept { return statuses_; }

  /// Reads until `is_met`, which is checked after each frame; false if that takes too long.
  [[nodiscard]] bool read_until(const std::function<bool()>& is_met);
  [[nodiscard]] bool await_channel(const std::string& topic);
  [[nodiscard]] bool await_service(const std::string& name);
  /// Subscribes to an advertised channel.
  void subscribe(const std::string& topic);
  /// The next message of a topic; the test fails if none comes.
  [[nodiscard]] Message next_message(const std::string& topic);
  /// The first message of a topic, in JSON, that `is_met` accepts; the test fails if none comes.
  [[nodiscard]] Json await_message(const std::string& topic,
                                   const std::function<bool(const Json&)>& is_met);
  /// The first State that `is_met` accepts; the test fails if none comes.
  [[nodiscard]] Json await_state(const std::function<bool(const Json&)>& is_met);
  /// The answer to a call; {"failure": "…"} if it failed.
  [[nodiscard]] Json call(const std::string& service, const Json& request);
  /// The answer to a call whose request need not be JSON; nullopt if the call failed.
  [[nodiscard]] std::optional<std::string> call_text(const std::string& service,
                                                     const std::string& request);
  /// Sends a request without waiting for its answer; returns the call's number for answer_of().
  [[nodiscard]] std::uint32_t begin_call(const std::string& service, const Json& request);
  /// The answer, like call()'s; the test fails if none comes.
  [[nodiscard]] Json answer_of(std::uint32_t call);
  /// Takes the next frame; false if none comes in time.
  bool read_one(Duration patience);
  /// The bytes of the answer to a call with the encoding flatbuffer.
  [[nodiscard]] std::optional<std::string> call_bytes(const std::string& service,
                                                      const std::string& payload);
  void send(const Json& request) { web_.send_text(request.dump()); }
  /// The values that the next parameterValues with this id has; the test fails if none comes.
  [[nodiscard]] std::map<std::string, Json> await_parameters(const std::string& id);
  /// The next text frame whose op is `op`.
  [[nodiscard]] Json await_op(const std::string& op);

 private:
  [[nodiscard]] std::optional<std::string> call_as(const std::string& service,
                                                   const std::string& encoding,
                                                   const std::string& payload,
                                                   std::string& failure);
  /// Calls an advertised service.
  [[nodiscard]] std::uint32_t send_call(const std::string& service, const std::string& encoding,
                                        const std::string& payload);
  [[nodiscard]] std::optional<std::string> take_answer(std::uint32_t call, std::string& failure);
  void take_text(const Json& text);
  void take_binary(const std::string& bytes);

  WebClient web_;
  Json info_{};
  std::map<std::string, Json> channels_{};
  std::map<std::string, Json> services_{};
  std::map<std::uint32_t, std::string> subscriptions_{};
  std::vector<Message> messages_{};
  std::vector<Json> texts_{};
  std::vector<Json> statuses_{};
  std::map<std::uint32_t, std::pair<bool, std::string>> answers_{};  ///< Answers by call.
  std::uint32_t last_subscription_ = 0;
  std::uint32_t last_call_ = 0;
};

/// A registry, the simulated arm with a hub, and a console.
class ConsoleSystem : public testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;
  /// Starts `registry_`, whose URL may be a list; false if the test has failed.
  [[nodiscard]] virtual bool start_registry();
  [[nodiscard]] std::vector<std::string> console_arguments() const;
  [[nodiscard]] std::optional<Daemon> start_devices(std::uint16_t port = 0) const;
  [[nodiscard]] std::unique_ptr<ConsoleClient> connect() const;
  /// Connects, and waits until the console reads the arm and hears the hub.
  [[nodiscard]] std::unique_ptr<ConsoleClient> connect_to_arm() const;
  [[nodiscard]] test::Process::End rtpm(std::vector<std::string> arguments) const;

  std::string folder_{};
  std::string realtime_ = "off";  ///< The mode of the daemons.
  std::optional<Daemon> registry_{};
  std::optional<Daemon> devices_{};
  std::optional<ConsoleProcess> console_{};
};

/// The device of this name in a State; null if it is not there.
[[nodiscard]] Json device_in(const Json& state, const std::string& name);
/// Whether the device is there and `ok`.
[[nodiscard]] bool is_live(const Json& state, const std::string& name);

}  // namespace rtpm::system_test
