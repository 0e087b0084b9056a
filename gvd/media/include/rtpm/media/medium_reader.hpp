#pragma once

#include <cstdint>
#include <media.rtpm.hpp>
#include <memory>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::media {

/// A piece as it arrived, on this host's clock.
/// @ownership refers to its bytes, which are valid during the call that has it
struct ReceivedPiece {
  ConstBytes bytes{};
  MonotonicTime captured{};
  /// How far `captured` may be off, with that of the server's clock.
  Duration uncertainty{};
  std::uint64_t sequence = 0;
  std::uint64_t lost_count = 0;  ///< Since the stream began.
  bool is_key = true;
};

/// Receives a medium's pieces.
/// @threads  all methods on the reader's thread
class MediumSink {
 public:
  MediumSink() = default;
  MediumSink(const MediumSink&) = delete;
  MediumSink& operator=(const MediumSink&) = delete;
  virtual ~MediumSink() = default;
  /// The description, with the formats of the pieces that follow.
  virtual void on_description(const MediumDescriptionT& about) = 0;
  virtual void on_video(const ReceivedPiece& piece) = 0;
  virtual void on_sound(const ReceivedPiece& piece) = 0;
  /// Why no pieces come, for people.
  virtual void on_problem(const std::string& problem) = 0;
};

/// Configures a reader.
struct MediumReaderConfig {
  bool wants_video = true;
  bool wants_sound = true;
  /// How many pieces may be on the way, 1…32. A reader that wants the newest takes few, one that
  /// wants all takes many.
  std::uint32_t window = 2;
};

/// Reads a medium on its own time-shared thread, and begins again when its server comes back.
/// @ownership refers to its node and its sink, which must outlive it
/// @threads  start and destroy from one thread
class MediumReader {
 public:
  /// Binds `medium`, a name or a URL, and starts.
  /// @realtime set-up only
  /// @errors   those of rpc::Binding::bind(): no such medium; it does not answer; no right
  [[nodiscard]] static expected<MediumReader, SetupError> start(rpc::Node& node, std::string medium,
                                                                MediumReaderConfig config,
                                                                MediumSink& sink);
  MediumReader(MediumReader&&) noexcept;
  MediumReader& operator=(MediumReader&&) noexcept;
  /// Calls stop().
  ~MediumReader();

  /// Ends the thread after the piece at hand. May be called again, but not by the sink.
  void stop() noexcept;

 private:
  struct Impl;
  explicit MediumReader(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::media
