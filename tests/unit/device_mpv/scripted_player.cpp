#include "scripted_player.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

namespace rtpm::test {

using nlohmann::json;

bool ScriptedPlayer::send(std::string_view bytes) {
  ++command_count_;
  if (is_faulty() && (fault_ == PlayerFault::kDies || fault_ == PlayerFault::kFull)) {
    return fault_ == PlayerFault::kDies && faulty_from_ % 2 == 0;
  }
  take(std::string(bytes.substr(0, bytes.find('\n'))));
  return true;
}

void ScriptedPlayer::take(const std::string& line) {
  const json command = json::parse(line);
  const json& words = command["command"];
  std::string text;
  for (const json& word : words) {
    if (!text.empty()) text += ' ';
    text += word.is_string() ? word.get<std::string>() : word.dump();
  }
  const std::string name = words[0];
  std::string data = "null";
  if (name == "get_property") {
    data = value_of(words[1]);
  } else {
    commands_.push_back(text);
  }
  const bool is_loaded = !is_faulty() || fault_ != PlayerFault::kNothingLoaded;
  if (name == "seek" && is_loaded) {
    position_s_ = words[1];
    seek_end_ = now_ + seek_time_;
  } else if (name == "set_property") {
    const std::string property = words[1];
    if (property == "pause") is_paused_ = words[2];
    if (property == "speed") speed_ = words[2];
    if (property == "play-dir") is_backwards_ = words[2] == "backward";
  }
  answer(command["request_id"], data);
}

std::string ScriptedPlayer::value_of(const std::string& property) const {
  if (property == "time-pos") return json(position_s_).dump();
  if (property == "duration") return json(kDurationSeconds).dump();
  if (property == "speed") return json(speed_).dump();
  if (property == "container-fps") return json(1 / kFrameSeconds).dump();
  if (property == "pause") return json(is_paused_).dump();
  if (property == "seeking") return json(now_ < seek_end_).dump();
  return "";
}

void ScriptedPlayer::answer(std::int64_t request_id, const std::string& data) {
  const std::string id = std::to_string(request_id);
  std::string bytes = "{\"data\":" + data + ",\"request_id\":" + id + ",\"error\":\"success\"}\n";
  MonotonicTime due = now_;
  if (is_faulty()) {
    switch (fault_) {
      case PlayerFault::kHangs:
        return;
      case PlayerFault::kGarbage:
        bytes = "}{ \xff\xfe" + id + "\n";
        break;
      case PlayerFault::kWrongTypes:
        bytes = "{\"data\":{},\"request_id\":\"" + id + "\",\"error\":7}\n[]\n3\n";
        break;
      case PlayerFault::kWrongIds:
        bytes = "{\"data\":1,\"request_id\":-9223372036854775808,\"error\":\"success\"}\n";
        break;
      case PlayerFault::kLate:
        due += kLateness;
        break;
      case PlayerFault::kLongLine:
        bytes = std::string(20'000, '[') + "\n" + bytes;
        break;
      case PlayerFault::kNothingLoaded:
        bytes = "{\"request_id\":" + id + ",\"error\":\"property unavailable\"}\n";
        break;
      default:
        break;
    }
  }
  pending_.push_back({due, bytes});
}

device_mpv::Received ScriptedPlayer::receive(std::span<char> buffer, Duration patience) {
  if (is_faulty() && fault_ == PlayerFault::kDies) return {0, true};
  if (pending_.empty() || pending_.front().due > now_) {
    const MonotonicTime end = now_ + patience;
    const MonotonicTime due = pending_.empty() ? end : pending_.front().due;
    advance(std::min(due, end) - now_);
    return {};
  }
  std::string& bytes = pending_.front().bytes;
  const std::size_t size_max =
      is_faulty() && fault_ == PlayerFault::kSplit ? std::size_t{1} : buffer.size();
  const std::size_t size = std::min(bytes.size(), size_max);
  std::copy_n(bytes.begin(), size, buffer.begin());
  bytes.erase(0, size);
  if (bytes.empty()) pending_.pop_front();
  return {size, false};
}

void ScriptedPlayer::advance(Duration time) {
  now_ += time;
  if (is_paused_ || now_ < seek_end_) return;
  const double step_s = speed_ * std::chrono::duration<double>(time).count();
  const double next_s = position_s_ + (is_backwards_ ? -step_s : step_s);
  position_s_ = std::clamp(next_s, 0.0, kDurationSeconds);
  if (next_s > kDurationSeconds) is_paused_ = true;
}

}  // namespace rtpm::test
