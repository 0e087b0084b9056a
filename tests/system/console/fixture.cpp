#include "fixture.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "rtpm/base/bytes.hpp"

namespace rtpm::system_test {
namespace {

using Clock = std::chrono::steady_clock;

}  // namespace

std::optional<ConsoleProcess> start_console(std::vector<std::string> arguments) {
  // Without a file of the test, those of the user stay as they are.
  const auto given = std::ranges::find(arguments, "--incidents");
  if (given == arguments.end()) arguments.insert(arguments.begin(), {"--incidents", "none"});
  arguments.insert(arguments.begin(), {path_of("rtpm-console"), "--print-token"});
  test::Process process(arguments);
  if (!process.wait_for_output("http://", kPatience) || !process.wait_for_output("\n", kPatience)) {
    ADD_FAILURE() << "rtpm-console does not serve: " << process.output() << process.errors();
    return std::nullopt;
  }
  const std::string url = process.output().substr(process.output().find("http://") + 7);
  const std::size_t colon = url.find(':');
  const std::size_t slash = url.find('/');
  const auto port = static_cast<std::uint16_t>(std::stoi(url.substr(colon + 1)));
  return ConsoleProcess{std::move(process), port,
                        url.substr(slash, url.find_first_of(" \n", slash) - slash)};
}

void ConsoleClient::take_text(const Json& text) {
  const std::string op = text.value("op", "");
  if (op == "serverInfo") info_ = text;
  if (op == "status") statuses_.push_back(text);
  if (op == "advertise") {
    for (const Json& channel : text["channels"])
      channels_[channel["topic"]] = channel;
  }
  if (op == "unadvertise") {
    std::erase_if(channels_, [&](const auto& one) {
      return std::ranges::count(text["channelIds"], one.second["id"]) > 0;
    });
  }
  if (op == "advertiseServices") {
    for (const Json& service : text["services"])
      services_[service["name"]] = service;
  }
  if (op == "unadvertiseServices") {
    std::erase_if(services_, [&](const auto& one) {
      return std::ranges::count(text["serviceIds"], one.second["id"]) > 0;
    });
  }
  if (op == "serviceCallFailure") answers_[text["callId"]] = {false, text["message"]};
  if (op == "parameterValues" || op == "connectionGraphUpdate") texts_.push_back(text);
}

void ConsoleClient::take_binary(const std::string& bytes) {
  ByteReader reader(std::as_bytes(std::span(bytes)));
  const auto rest = [&] {
    const ConstBytes left = reader.take_bytes(reader.left());
    return std::string(reinterpret_cast<const char*>(left.data()), left.size());
  };
  const auto opcode = reader.take<std::uint8_t>();
  if (opcode == 1) {
    const auto subscription = reader.take<std::uint32_t>();
    const auto log_time_ns = reader.take<std::uint64_t>();
    messages_.push_back({subscriptions_[subscription], log_time_ns, rest()});
  } else if (opcode == 3) {
    static_cast<void>(reader.take<std::uint32_t>());
    const auto call = reader.take<std::uint32_t>();
    static_cast<void>(reader.take_bytes(reader.take<std::uint32_t>()));
    answers_[call] = {true, rest()};
  }
}

bool ConsoleClient::read_one(Duration patience) {
  const auto frame = web_.next(patience);
  if (!frame) return false;
  if (frame->opcode == 8) {
    ADD_FAILURE() << "closed with " << frame->close_code() << ": " << frame->payload.substr(2);
    return false;
  }
  if (frame->is_text()) {
    take_text(Json::parse(frame->payload));
  } else {
    take_binary(frame->payload);
  }
  return true;
}

bool ConsoleClient::read_until(const std::function<bool()>& is_met) {
  const auto end = Clock::now() + kPatience;
  while (!is_met()) {
    if (Clock::now() >= end || !read_one(end - Clock::now())) return false;
  }
  return true;
}

bool ConsoleClient::await_channel(const std::string& topic) {
  return read_until([&] { return channels_.contains(topic); });
}

bool ConsoleClient::await_service(const std::string& name) {
  return read_until([&] { return services_.contains(name); });
}

void ConsoleClient::subscribe(const std::string& topic) {
  ASSERT_TRUE(await_channel(topic)) << topic;
  const std::uint32_t id = ++last_subscription_;
  subscriptions_[id] = topic;
  send({{"op", "subscribe"},
        {"subscriptions", Json::array({{{"id", id}, {"channelId", channels_[topic]["id"]}}})}});
}

ConsoleClient::Message ConsoleClient::next_message(const std::string& topic) {
  Message found;
  const bool is_there = read_until([&] {
    const auto at = std::ranges::find(messages_, topic, &Message::topic);
    if (at == messages_.end()) return false;
    found = *at;
    messages_.erase(messages_.begin(), at + 1);
    return true;
  });
  EXPECT_TRUE(is_there) << "no message of " << topic;
  return found;
}

Json ConsoleClient::await_message(const std::string& topic,
                                  const std::function<bool(const Json&)>& is_met) {
  const auto end = Clock::now() + kPatience;
  Json message;
  do {
    message = next_message(topic).json();
    if (message.is_object() && is_met(message)) return message;
  } while (Clock::now() < end && !message.is_discarded());
  ADD_FAILURE() << topic << " has no such message, the last is " << message;
  return message;
}

Json ConsoleClient::await_state(const std::function<bool(const Json&)>& is_met) {
  return await_message("console/state", is_met);
}

std::optional<std::string> ConsoleClient::call_as(const std::string& service,
                                                  const std::string& encoding,
                                                  const std::string& payload,
                                                  std::string& failure) {
  if (!await_service(service)) {
    failure = "there is no service " + service;
    return std::nullopt;
  }
  return take_answer(send_call(service, encoding, payload), failure);
}

std::uint32_t ConsoleClient::send_call(const std::string& service, const std::string& encoding,
                                       const std::string& payload) {
  const std::uint32_t call = ++last_call_;
  std::string frame(13 + encoding.size() + payload.size(), '\0');
  ByteWriter writer(std::as_writable_bytes(std::span(frame)));
  writer.put(std::uint8_t{2});
  writer.put(services_[service]["id"].get<std::uint32_t>());
  writer.put(call);
  writer.put(static_cast<std::uint32_t>(encoding.size()));
  writer.put_bytes(std::as_bytes(std::span(encoding)));
  writer.put_bytes(std::as_bytes(std::span(payload)));
  web_.send_binary(frame);
  return call;
}

std::optional<std::string> ConsoleClient::take_answer(std::uint32_t call, std::string& failure) {
  if (!read_until([&] { return answers_.contains(call); })) {
    failure = "no answer";
    return std::nullopt;
  }
  const auto [is_success, answer] = answers_[call];
  if (is_success) return answer;
  failure = answer;
  return std::nullopt;
}

Json ConsoleClient::call(const std::string& service, const Json& request) {
  std::string failure;
  const auto answer = call_as(service, "json", request.dump(), failure);
  return answer ? Json::parse(*answer, nullptr, false) : Json{{"failure", failure}};
}

std::uint32_t ConsoleClient::begin_call(const std::string& service, const Json& request) {
  EXPECT_TRUE(await_service(service)) << service;
  return send_call(service, "json", request.dump());
}

Json ConsoleClient::answer_of(std::uint32_t call) {
  std::string failure;
  const auto answer = take_answer(call, failure);
  return answer ? Json::parse(*answer, nullptr, false) : Json{{"failure", failure}};
}

std::optional<std::string> ConsoleClient::call_text(const std::string& service,
                                                    const std::string& request) {
  std::string failure;
  return call_as(service, "json", request, failure);
}

std::optional<std::string> ConsoleClient::call_bytes(const std::string& service,
                                                     const std::string& payload) {
  std::string failure;
  auto answer = call_as(service, "flatbuffer", payload, failure);
  EXPECT_TRUE(answer) << failure;
  return answer;
}

std::map<std::string, Json> ConsoleClient::await_parameters(const std::string& id) {
  std::map<std::string, Json> values;
  const bool is_there = read_until([&] {
    const auto found = std::ranges::find_if(texts_, [&](const Json& text) {
      return text["op"] == "parameterValues" && text.value("id", "") == id;
    });
    if (found == texts_.end()) return false;
    for (const Json& parameter : (*found)["parameters"])
      values[parameter["name"]] = parameter["value"];
    texts_.erase(found);
    return true;
  });
  EXPECT_TRUE(is_there) << "no parameterValues with the id '" << id << "'";
  return values;
}

Json ConsoleClient::await_op(const std::string& op) {
  Json found_text;
  const bool is_there = read_until([&] {
    const auto found =
        std::ranges::find_if(texts_, [&](const Json& text) { return text["op"] == op; });
    if (found == texts_.end()) return false;
    found_text = *found;
    texts_.erase(found);
    return true;
  });
  EXPECT_TRUE(is_there) << "no " << op;
  return found_text;
}

void ConsoleSystem::SetUp() {
  folder_ = testing::TempDir() + "rtpm_console_" + std::to_string(::getpid());
  std::filesystem::create_directories(folder_ + "/page");
  std::filesystem::create_directories(folder_ + "/recordings");
  ASSERT_TRUE(start_registry());
  devices_ = start_devices();
  ASSERT_TRUE(devices_);
  console_ = start_console(console_arguments());
  ASSERT_TRUE(console_);
}

bool ConsoleSystem::start_registry() {
  registry_ = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", realtime_});
  return registry_.has_value();
}

void ConsoleSystem::TearDown() {
  console_.reset();
  std::filesystem::remove_all(folder_);
}

std::vector<std::string> ConsoleSystem::console_arguments() const {
  return {"--port",       "0",
          "--registry",   registry_->url,
          "--page",       folder_ + "/page",
          "--recordings", folder_ + "/recordings"};
}

std::optional<Daemon> ConsoleSystem::start_devices(std::uint16_t port) const {
  return start_daemon("rtpm-deviced", {"--port", std::to_string(port), "--registry", registry_->url,
                                       "--realtime", realtime_, "--serve-events"});
}

std::unique_ptr<ConsoleClient> ConsoleSystem::connect() const {
  return std::make_unique<ConsoleClient>(console_->port, console_->target);
}

std::unique_ptr<ConsoleClient> ConsoleSystem::connect_to_arm() const {
  auto client = connect();
  client->subscribe("console/state");
  static_cast<void>(client->await_state(
      [](const Json& state) { return is_live(state, "lab/arm0") && state["hub"]["ok"] == true; }));
  return client;
}

test::Process::End ConsoleSystem::rtpm(std::vector<std::string> arguments) const {
  arguments.insert(arguments.end(), {"--registry", registry_->url});
  return run_program("rtpm", arguments);
}

Json device_in(const Json& state, const std::string& name) {
  for (const Json& device : state["devices"]) {
    if (device["name"] == name) return device;
  }
  return {};
}

bool is_live(const Json& state, const std::string& name) {
  const Json device = device_in(state, name);
  return device.is_object() && device.value("ok", false);
}

}  // namespace rtpm::system_test
