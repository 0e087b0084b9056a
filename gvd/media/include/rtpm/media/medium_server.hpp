#pragma once

#include <cstddef>
#include <cstdint>
#include <media.rtpm.hpp>
#include <mutex>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::media {

/// An encoded picture, or a piece of sound.
/// @ownership refers to its bytes
struct Piece {
  ConstBytes bytes{};
  MonotonicTime captured{};  ///< A sound's is that of its first sample.
  Duration uncertainty{};    ///< How far `captured` may be off.
  bool is_key = true;        ///< It can be decoded without earlier pieces.
};

/// Serves one medium: hands each piece to all readers at once. No piece waits for a reader: one
/// without credit misses it, and of pictures that need earlier ones all up to the next key frame.
/// @threads  any
/// @realtime none
class MediumServer final : public MediumServant {
 public:
  /// The readers of pictures, and those of sound, at a time. More are refused with overload.
  static constexpr std::size_t kReaderCountMax = 16;
  /// The shortest time between two requests for a key frame.
  static constexpr Duration kKeyFrameInterval = std::chrono::milliseconds{250};

  /// @param about  the description; set_video() and set_sound() complete it
  explicit MediumServer(MediumDescriptionT about);
  ~MediumServer() override = default;

  /// Sets the format of the pictures. Their codec tells whether they need key frames.
  void set_video(const VideoFormatT& format);
  void set_sound(const SoundFormatT& format);
  /// @param latency  from a capture until its piece comes here, as the pipeline claims
  void set_latency(Duration latency);

  /// Gives the readers a picture.
  /// @return whether a reader needs a key frame and the encoder should be asked for one now
  [[nodiscard]] bool push_video(const Piece& piece);
  void push_sound(const Piece& piece);
  /// Notes that pieces come. The second call counts as a restart, and so on.
  void begin();
  /// Notes, and tells the readers, why no pieces come.
  void report(const std::string& problem);

  rpc::Result<void> describe(rpc::ReplyBuilder<MediumDescription>& reply,
                             const rpc::CallContext& context) override;
  rpc::Result<void> state(rpc::ReplyBuilder<MediumState>& reply,
                          const rpc::CallContext& context) override;
  void frames(rpc::TableWriter<MediumItem> items, const rpc::CallContext& context) override;
  void sound(rpc::TableWriter<MediumItem> items, const rpc::CallContext& context) override;
  rpc::Result<void> request_key_frame(const rpc::CallContext& context) override;

 private:
  struct Reader {
    rpc::TableWriter<MediumItem> items;
    std::uint64_t lost_count = 0;
    bool needs_key = true;
    bool has_begun = false;  ///< It got an item.
  };
  /// The readers of pictures, or those of sound.
  struct Line {
    std::vector<Reader> readers{};
    std::uint64_t sequence = 0;  ///< The newest piece's.
  };

  void add(Line& line, bool is_served, rpc::TableWriter<MediumItem> items);
  void push(Line& line, const Piece& piece);
  void give(Reader& reader, const Line& line, const Piece& piece);
  [[nodiscard]] bool write(Reader& reader, const MediumStamp& stamp, ConstBytes bytes,
                           const std::string& problem);

  mutable rt::PiMutex mutex_;
  MediumDescriptionT about_;
  Line video_{};
  Line sound_{};
  std::uint8_t lifecycle_ = 1;
  std::string problem_{};
  std::uint32_t begin_count_ = 0;
  std::uint64_t lost_count_ = 0;
  bool wants_key_ = false;
  MonotonicTime key_asked_{};  ///< When the encoder was asked last.
  flatbuffers::FlatBufferBuilder builder_{64 * 1024};
};

}  // namespace rtpm::media
