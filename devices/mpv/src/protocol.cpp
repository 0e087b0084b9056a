#include "rtpm/device_mpv/protocol.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "rtpm/base/nesting.hpp"

namespace rtpm::device_mpv {

using nlohmann::json;

Message parse(std::string_view line) {
  const json message = parse_bounded_json<json>(line);
  if (!message.is_object()) return Unreadable{};
  if (message.contains("event")) return Event{};
  const auto id = message.find("request_id");
  const auto error = message.find("error");
  if (id == message.end() || !id->is_number_integer()) return Unreadable{};
  if (error == message.end() || !error->is_string()) return Unreadable{};
  Reply reply;
  reply.request_id = id->get<std::int64_t>();
  reply.is_success = error->get_ref<const std::string&>() == "success";
  if (const auto data = message.find("data"); data != message.end()) {
    if (data->is_boolean()) reply.flag = data->get<bool>();
    if (data->is_number()) reply.number = data->get<double>();
    if (reply.number && !std::isfinite(*reply.number)) return Unreadable{};
  }
  return reply;
}

std::string command_line(std::int64_t request_id, std::string_view name,
                         std::initializer_list<Word> arguments) {
  json words = json::array({name});
  for (const Word& argument : arguments)
    std::visit([&](const auto& word) { words.push_back(word); }, argument);
  const json command{{"command", std::move(words)}, {"request_id", request_id}};
  return command.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
}

}  // namespace rtpm::device_mpv
