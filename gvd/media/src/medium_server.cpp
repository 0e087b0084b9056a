#include "rtpm/media/medium_server.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::media {
namespace {

constexpr std::uint8_t kStarting = 1;
constexpr std::uint8_t kActive = 2;
constexpr std::uint8_t kFault = 3;

}  // namespace

MediumServer::MediumServer(MediumDescriptionT about) : about_(std::move(about)) {
  video_.readers.reserve(kReaderCountMax);
  sound_.readers.reserve(kReaderCountMax);
}

void MediumServer::set_video(const VideoFormatT& format) {
  const std::lock_guard lock(mutex_);
  about_.video = std::make_unique<VideoFormatT>(format);
}

void MediumServer::set_sound(const SoundFormatT& format) {
  const std::lock_guard lock(mutex_);
  about_.sound = std::make_unique<SoundFormatT>(format);
}

void MediumServer::set_latency(Duration latency) {
  const std::lock_guard lock(mutex_);
  about_.latency_us =
      static_cast<std::uint32_t>(std::max<std::int64_t>(0, latency / std::chrono::microseconds{1}));
}

bool MediumServer::push_video(const Piece& piece) {
  const std::lock_guard lock(mutex_);
  if (piece.is_key) wants_key_ = false;
  push(video_, piece);
  if (!wants_key_ || piece.captured < key_asked_ + kKeyFrameInterval) return false;
  key_asked_ = piece.captured;
  return true;
}

void MediumServer::push_sound(const Piece& piece) {
  const std::lock_guard lock(mutex_);
  push(sound_, piece);
}

void MediumServer::push(Line& line, const Piece& piece) {
  ++line.sequence;
  std::erase_if(line.readers, [](const Reader& reader) { return !reader.items.is_awaited(); });
  for (Reader& reader : line.readers)
    give(reader, line, piece);
}

void MediumServer::give(Reader& reader, const Line& line, const Piece& piece) {
  const bool may_follow = piece.is_key || !reader.needs_key;
  const MediumStamp stamp(line.sequence, to_ns(piece.captured), piece.uncertainty.count(),
                          reader.lost_count, piece.is_key);
  // An item that waits for credit would be old when it arrives: it stays the only one.
  if (may_follow && reader.items.waiting_count() == 0 && write(reader, stamp, piece.bytes, {})) {
    reader.needs_key = false;
    reader.has_begun = true;
    return;
  }
  // Before its first key frame a reader misses nothing.
  if (reader.has_begun) {
    ++reader.lost_count;
    ++lost_count_;
  }
  reader.needs_key = true;
  wants_key_ = wants_key_ || &line == &video_;
}

bool MediumServer::write(Reader& reader, const MediumStamp& stamp, ConstBytes bytes,
                         const std::string& problem) {
  builder_.Clear();
  const auto data =
      builder_.CreateVector(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  const auto words = problem.empty() ? 0 : builder_.CreateString(problem);
  builder_.Finish(CreateMediumItem(builder_, &stamp, data, words));
  return reader.items.write(builder_).has_value();
}

void MediumServer::begin() {
  const std::lock_guard lock(mutex_);
  ++begin_count_;
  lifecycle_ = kActive;
  problem_.clear();
}

void MediumServer::report(const std::string& problem) {
  const std::lock_guard lock(mutex_);
  lifecycle_ = begin_count_ == 0 && problem.empty() ? kStarting : kFault;
  problem_ = problem;
  for (Line* line : {&video_, &sound_}) {
    for (Reader& reader : line->readers) {
      const MediumStamp stamp(line->sequence, to_ns(rt::now()), 0, reader.lost_count, false);
      // A reader that does not keep up learns it from state().
      static_cast<void>(write(reader, stamp, {}, problem));
      reader.needs_key = true;
    }
  }
}

rpc::Result<void> MediumServer::describe(rpc::ReplyBuilder<MediumDescription>& reply,
                                         const rpc::CallContext&) {
  const rt::AllowAllocationScope is_allowed;
  const std::lock_guard lock(mutex_);
  reply.finish(MediumDescription::Pack(reply.builder(), &about_));
  return {};
}

rpc::Result<void> MediumServer::state(rpc::ReplyBuilder<MediumState>& reply,
                                      const rpc::CallContext&) {
  const std::lock_guard lock(mutex_);
  auto& builder = reply.builder();
  const auto problem = problem_.empty() ? 0 : builder.CreateString(problem_);
  reply.finish(
      CreateMediumState(builder, lifecycle_, problem, begin_count_ == 0 ? 0 : begin_count_ - 1,
                        static_cast<std::uint32_t>(video_.readers.size() + sound_.readers.size()),
                        video_.sequence, sound_.sequence, lost_count_));
  return {};
}

void MediumServer::frames(rpc::TableWriter<MediumItem> items, const rpc::CallContext&) {
  const std::lock_guard lock(mutex_);
  wants_key_ = true;
  add(video_, about_.video != nullptr, std::move(items));
}

void MediumServer::sound(rpc::TableWriter<MediumItem> items, const rpc::CallContext&) {
  const std::lock_guard lock(mutex_);
  add(sound_, about_.sound != nullptr, std::move(items));
}

// The vectors have their capacity already, so a lane allocates nothing here.
void MediumServer::add(Line& line, bool is_served, rpc::TableWriter<MediumItem> items) {
  std::erase_if(line.readers, [](const Reader& reader) { return !reader.items.is_awaited(); });
  if (!is_served) return items.finish();
  if (line.readers.size() >= kReaderCountMax) return items.fail(rpc::Refusal::kOverload);
  line.readers.push_back({.items = std::move(items)});
}

rpc::Result<void> MediumServer::request_key_frame(const rpc::CallContext&) {
  const std::lock_guard lock(mutex_);
  wants_key_ = true;
  return {};
}

}  // namespace rtpm::media
