#include "recording/record_desk.hpp"

#include <utility>

#include "foxglove/base64.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::console {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr Duration kHubDeadline = std::chrono::milliseconds{500};
/// The cameras and microphones of one recording.
constexpr std::size_t kMediaCountMax = 16;
/// The devices, and the topics, that a session selects.
constexpr std::size_t kSelectedCountMax = 512;
/// The time limit for opening a recording; one without a summary is read completely.
constexpr Duration kOpenTimeMax = std::chrono::seconds{20};

std::string text_at(const nlohmann::json& request, const char* key) {
  const auto found = request.find(key);
  return found != request.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

/// The texts of a list, at most `count_max`.
std::vector<std::string> texts_in(const nlohmann::json& request, const char* key,
                                  std::size_t count_max) {
  std::vector<std::string> texts;
  const auto found = request.find(key);
  if (found == request.end() || !found->is_array()) return texts;
  for (const nlohmann::json& one : *found) {
    if (one.is_string() && texts.size() < count_max) texts.push_back(one.get<std::string>());
  }
  return texts;
}

/// Sets file and session of the recording that a session's request describes.
expected<std::string, SetupError> read_session(const nlohmann::json& request,
                                               const RecordingFolder& folder,
                                               capture::LiveRecordingConfig& config) {
  capture::Session session{.participant = text_at(request, "participant"),
                           .experiment = text_at(request, "experiment"),
                           .condition = text_at(request, "condition"),
                           .notes = text_at(request, "notes")};
  if (auto checked = capture::check(session); !checked) return unexpected{checked.error()};
  std::string pattern = text_at(request, "pattern");
  if (pattern.empty()) pattern = capture::kSessionPattern;
  const auto file = capture::session_file(pattern, session, rt::utc_ns(rt::now()));
  if (!file) return file;
  const auto path = folder.path_of(*file);
  if (!path) return unexpected{path.error()};
  config.devices = texts_in(request, "devices", kSelectedCountMax);
  config.topics = texts_in(request, "topics", kSelectedCountMax);
  config.session = std::move(session);
  return std::filesystem::path(capture::free_path(path->string())).filename().string();
}

foxglove::ChannelInfo channel_info(const recording::Channel& channel,
                                   const std::map<std::uint16_t, recording::Schema>& schemas) {
  foxglove::ChannelInfo info{.topic = "replay/" + channel.topic,
                             .encoding = channel.message_encoding};
  const auto schema = schemas.find(channel.schema_id);
  if (schema == schemas.end()) return info;
  info.schema_name = schema->second.name;
  info.schema_encoding = schema->second.encoding;
  const ConstBytes data(schema->second.data);
  const bool is_binary = info.schema_encoding == "flatbuffer" || info.schema_encoding == "protobuf";
  info.schema = is_binary ? foxglove::to_base64(data)
                          : std::string(reinterpret_cast<const char*>(data.data()), data.size());
  return info;
}

}  // namespace

RecordDesk::RecordDesk(rpc::Node& node, Config config, CallRouter& router, ChannelTable& channels,
                       WorkerPool& pool, Post post)
    : node_(node),
      config_(std::move(config)),
      router_(router),
      channels_(channels),
      pool_(pool),
      post_(std::move(post)),
      folder_(config_.folder) {}

expected<void, SetupError> RecordDesk::start() {
  const auto add = [this](const char* name, auto handler) {
    router_.add_json(std::string("console/") + name, std::move(handler));
  };
  add("record_start",
      [this](const PendingCall& call, const Json& request) { start_recording(call, request); });
  add("record_stop", [this](const PendingCall& call, const Json&) { stop_recording(call); });
  // A session is a recording that states it: either ends the other.
  add("session_start", [this](const PendingCall& call, const Json& request) {
    start_recording(call, request, /*is_session=*/true);
  });
  add("session_stop", [this](const PendingCall& call, const Json&) { stop_recording(call); });
  add("recordings", [this](const PendingCall& call, const Json&) { list(call); });
  add("replay_open",
      [this](const PendingCall& call, const Json& request) { open_replay(call, request); });
  // Adds a command on the open recording; `command` returns why it failed, or an empty text.
  const auto add_command = [&](const char* name, auto command) {
    add(name, [this, command](const PendingCall& call, const Json& request) {
      if (!player_) return router_.fail(call, "no recording is open; open one first");
      const std::string_view problem = command(*player_, request);
      if (!problem.empty()) return router_.fail(call, std::string(problem));
      router_.succeed(call, OrderedJson::object());
    });
  };
  add_command("replay_seek", [](ReplayPlayer& player, const Json& request) -> std::string_view {
    const auto time = request.find("time_ns");
    if (time == request.end() || !time->is_number() || time->get<double>() < 0) {
      return "replay_seek needs `time_ns`";
    }
    player.seek(time->is_number_float()
                    ? static_cast<std::uint64_t>(std::min(time->get<double>(), 1.8e19))
                    : time->get<std::uint64_t>());
    return {};
  });
  add_command("replay_play", [](ReplayPlayer& player, const Json& request) -> std::string_view {
    const auto speed = request.find("speed");
    player.play(speed != request.end() && speed->is_number() ? speed->get<double>() : 1);
    return {};
  });
  add_command("replay_pause", [](ReplayPlayer& player, const Json&) -> std::string_view {
    player.pause();
    return {};
  });
  add("replay_close", [this](const PendingCall& call, const Json&) {
    close_replay();
    router_.succeed(call, OrderedJson::object());
  });
  return reading_.start({.name = "console-files", .thread_count = 1, .queued_max = 16});
}

recording::Progress RecordDesk::patience(std::uint64_t replay_id) {
  return [this, replay_id, end = rt::now() + kOpenTimeMax](std::uint64_t, std::uint64_t) {
    return !is_ending_ && replay_id == replay_id_ && rt::now() < end;
  };
}

void RecordDesk::start_recording(const PendingCall& call, const Json& request, bool is_session) {
  {
    const std::lock_guard lock(mutex_);
    if (is_changing_ || recording_) {
      return router_.fail(call, recorded_file_ + " is being recorded; stop it first");
    }
  }
  if (config_.folder.empty()) {
    return router_.fail(call,
                        "rtpm-console has no folder for recordings: start it with "
                        "--recordings FOLDER");
  }
  capture::LiveRecordingConfig config{.hub = config_.hub,
                                      .registry = config_.registry,
                                      .deadline = kHubDeadline,
                                      .media = texts_in(request, "media", kMediaCountMax)};
  std::string file = text_at(request, "file");
  if (is_session) {
    auto named = read_session(request, folder_, config);
    if (!named) return router_.fail(call, named.error().text());
    file = std::move(*named);
  }
  if (file.empty()) file = recording::name_by_time();
  const auto path = folder_.path_of(file);
  if (!path) return router_.fail(call, path.error().text());
  is_changing_ = true;
  const bool is_queued =
      pool_.run("recording", [this, call, file, path = *path, config = std::move(config)] {
        std::string problem;
        std::shared_ptr<capture::LiveRecording> created;
        if (auto recording = capture::LiveRecording::start(node_, path.string(), config)) {
          created = std::move(*recording);
        } else {
          problem = recording.error().text();
        }
        post_([this, call, file, problem, created, session = config.session] {
          is_changing_ = false;
          if (!created) return router_.fail(call, problem);
          {
            const std::lock_guard lock(mutex_);
            recording_ = created;
          }
          recorded_file_ = file;
          session_ = session;
          problem_.clear();
          router_.succeed(call, OrderedJson{{"file", file}});
        });
      });
  if (is_queued) return;
  is_changing_ = false;
  router_.fail(call, "too much waits to be done; try again");
}

void RecordDesk::stop_recording(const PendingCall& call) {
  std::shared_ptr<capture::LiveRecording> ended;
  {
    const std::lock_guard lock(mutex_);
    if (!is_changing_) ended = std::exchange(recording_, nullptr);
  }
  if (!ended) return router_.fail(call, "nothing is being recorded");
  is_changing_ = true;
  const bool is_queued = pool_.run("recording", [this, call, ended] {
    const auto closed = ended->stop();
    const capture::LiveRecordingStatus status = ended->status();
    post_([this, call, status, problem = closed ? std::string{} : closed.error().text()] {
      is_changing_ = false;
      session_.reset();
      problem_ = problem;
      if (!problem.empty()) return router_.fail(call, problem);
      router_.succeed(call,
                      OrderedJson{{"file", recorded_file_},
                                  {"message_count", status.recorder.message_count},
                                  {"drop_count", status.recorder.drop_count + status.lost_count},
                                  {"byte_count", status.recorder.byte_count},
                                  {"missing", status.reports}});
    });
  });
  if (!is_queued) {
    is_changing_ = false;
    router_.fail(call, "too much waits to be done; the recording ends all the same");
  }
}

void RecordDesk::list(const PendingCall& call) {
  if (config_.folder.empty()) {
    return router_.succeed(call, OrderedJson{{"files", OrderedJson::array()}});
  }
  const bool is_queued = reading_.run("recordings", [this, call] {
    const std::vector<std::string> purged = folder_.purge(rt::utc_ns(rt::now()));
    const RecordingList list = folder_.list();
    OrderedJson files = OrderedJson::array();
    for (const RecordingFile& file : list.files) {
      files.push_back({{"file", file.file},
                       {"byte_count", file.byte_count},
                       {"begin_ns", file.begin_ns},
                       {"end_ns", file.end_ns},
                       {"message_count", file.message_count},
                       {"is_complete", file.is_complete},
                       {"session", file.session}});
    }
    OrderedJson deleted = OrderedJson::array();
    for (const DeletedRecording& each : folder_.deleted()) {
      deleted.push_back({{"id", each.id},
                         {"file", each.file},
                         {"deleted_ns", each.deleted_ns},
                         {"byte_count", each.byte_count}});
    }
    const OrderedJson reply{{"files", std::move(files)},
                            {"omitted_count", list.omitted_count},
                            {"deleted", std::move(deleted)},
                            {"purged", purged}};
    post_([this, call, reply] { router_.succeed(call, reply); });
  });
  if (!is_queued) router_.fail(call, "too much waits to be done; try again");
}

void RecordDesk::open_replay(const PendingCall& call, const Json& request) {
  const std::string file = text_at(request, "file");
  const auto path = folder_.path_of(file);
  if (!path) return router_.fail(call, path.error().text());
  close_replay();
  const std::uint64_t id = replay_id_;
  const bool is_queued = reading_.run("recordings", [this, call, file, id, path = *path] {
    auto opened = ReplayPlayer::open(
        path.string(),
        [this, id](std::uint16_t channel, std::uint64_t log_time_ns, std::string payload) {
          post_([this, id, channel, log_time_ns, payload = std::move(payload)]() mutable {
            deliver(id, channel, log_time_ns, std::move(payload));
          });
        },
        patience(id));
    std::shared_ptr<ReplayPlayer> player;
    std::string problem;
    if (opened) {
      player = std::move(*opened);
    } else {
      problem = opened.error().text();
    }
    post_([this, call, file, id, player, problem] {
      if (!player) return router_.fail(call, problem);
      if (id != replay_id_) return router_.fail(call, "another recording was opened meanwhile");
      show_replay(call, file, player);
    });
  });
  if (!is_queued) router_.fail(call, "too much waits to be done; try again");
}

void RecordDesk::show_replay(const PendingCall& call, const std::string& file,
                             std::shared_ptr<ReplayPlayer> player) {
  player_ = std::move(player);
  played_file_ = file;
  OrderedJson topics = OrderedJson::array();
  for (const auto& [number, channel] : player_->channels()) {
    replay_channels_[number] = channels_.add(channel_info(channel, player_->schemas()));
    topics.push_back(channel.topic);
  }
  router_.succeed(call, OrderedJson{{"begin_ns", player_->begin_ns()},
                                    {"end_ns", player_->end_ns()},
                                    {"topics", std::move(topics)}});
}

void RecordDesk::close_replay() {
  ++replay_id_;  // Late messages from the previous player then match no channel.
  if (!player_) return;
  for (const auto& [number, channel] : player_->channels())
    channels_.remove("replay/" + channel.topic);
  replay_channels_.clear();
  played_file_.clear();
  // The destructor waits while a chunk is being read.
  std::shared_ptr<ReplayPlayer> ended = std::exchange(player_, nullptr);
  static_cast<void>(
      pool_.run("recordings", [ended = std::move(ended)]() mutable { ended.reset(); }));
}

void RecordDesk::deliver(std::uint64_t replay_id, std::uint16_t channel, std::uint64_t log_time_ns,
                         std::string payload) {
  if (replay_id != replay_id_) return;
  const auto found = replay_channels_.find(channel);
  if (found != replay_channels_.end()) {
    channels_.publish(found->second, log_time_ns, std::move(payload));
  }
}

std::string RecordDesk::use_of(const std::string& file) const {
  const std::lock_guard lock(mutex_);
  if ((recording_ || is_changing_) && file == recorded_file_) return file + " is being recorded";
  if (player_ && file == played_file_) return file + " is being replayed; close it first";
  return {};
}

nlohmann::ordered_json RecordDesk::recording_json() const {
  std::shared_ptr<capture::LiveRecording> recording;
  {
    const std::lock_guard lock(mutex_);
    recording = recording_;
  }
  if (!recording) {
    return {{"file", nullptr}, {"time_s", 0},     {"message_count", 0},
            {"byte_count", 0}, {"drop_count", 0}, {"problem", problem_}};
  }
  OrderedJson session;
  if (session_) {
    session = {{"participant", session_->participant},
               {"experiment", session_->experiment},
               {"condition", session_->condition},
               {"notes", session_->notes}};
  }
  const capture::LiveRecordingStatus status = recording->status();
  const auto& problem = status.recorder.problem;
  return {{"file", recorded_file_},
          {"time_s", std::chrono::duration<double>(status.time).count()},
          {"message_count", status.recorder.message_count},
          {"byte_count", status.recorder.byte_count},
          {"drop_count", status.recorder.drop_count + status.lost_count},
          {"problem", problem ? problem->reason() : std::string{}},
          {"session", std::move(session)},
          {"missing", status.reports}};
}

nlohmann::ordered_json RecordDesk::replay_json() const {
  if (!player_) {
    return {{"file", nullptr}, {"begin_ns", 0},       {"end_ns", 0},   {"time_ns", 0},
            {"speed", 1.0},    {"is_playing", false}, {"problem", ""}, {"topics", Json::array()}};
  }
  const replay::Playback::Status status = player_->status();
  OrderedJson topics = OrderedJson::array();
  for (const auto& [number, channel] : player_->channels())
    topics.push_back(channel.topic);
  return {{"file", played_file_},        {"begin_ns", player_->begin_ns()},
          {"end_ns", player_->end_ns()}, {"time_ns", player_->time_ns(status.position.at)},
          {"speed", status.speed},       {"is_playing", status.is_playing},
          {"problem", status.problem},   {"topics", std::move(topics)}};
}

void RecordDesk::stop_reading() {
  is_ending_ = true;
  reading_.stop();
}

void RecordDesk::close() {
  player_.reset();
  const std::lock_guard lock(mutex_);
  if (recording_) static_cast<void>(recording_->stop());
  recording_.reset();
}

}  // namespace rtpm::console
