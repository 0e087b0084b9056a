#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace rtpm::console {

/// Bytes shared by several connections.
using SharedText = std::shared_ptr<const std::string>;

/// A frame to send: its own header, and a body that several frames may share.
struct OutgoingFrame {
  std::array<std::byte, 16> head{};
  std::size_t head_size = 0;
  SharedText body{};
  bool is_text = false;
};

/// A client's queue of outgoing frames. If it is full, the oldest data is dropped, as old data is
/// worth less. Control frames must not be lost, so a client that does not read them is
/// disconnected.
/// @threads  one at a time
class SendQueue {
 public:
  static constexpr std::size_t kDataCountMax = 256;
  static constexpr std::size_t kDataByteMax = std::size_t{8} << 20;
  /// Limits of pictures: bytes of all subscriptions together, count of each.
  static constexpr std::size_t kPictureByteMax = std::size_t{4} << 20;
  static constexpr std::size_t kPictureCountMax = 8;
  static constexpr std::size_t kControlCountMax = 1024;
  static constexpr std::size_t kControlByteMax = std::size_t{32} << 20;

  explicit SendQueue(std::size_t data_byte_max = kDataByteMax) noexcept
      : data_byte_max_(data_byte_max) {}

  /// Appends data; drops and counts the oldest if above the limits.
  void push_data(OutgoingFrame frame) {
    data_byte_count_ += size_of(frame);
    data_.push_back(std::move(frame));
    while (data_.size() > kDataCountMax ||
           (data_byte_count_ > data_byte_max_ && data_.size() > 1)) {
      data_byte_count_ -= size_of(data_.front());
      data_.pop_front();
      ++dropped_count_;
    }
  }
  /// Appends a picture of a subscription, behind all other frames. A key frame replaces those of
  /// the subscription that wait: the newest picture wins. Another one is dropped if it is above the
  /// limits, and so are all after it up to the next key frame, as they need it.
  void push_picture(std::uint32_t subscription, OutgoingFrame frame, bool is_key) {
    if (is_key) drop_pictures(subscription);
    const auto waiting = static_cast<std::size_t>(std::ranges::count_if(
        pictures_, [&](const Picture& one) { return one.subscription == subscription; }));
    const std::size_t size = size_of(frame);
    const bool is_too_much = !pictures_.empty() && picture_byte_count_ + size > kPictureByteMax;
    const bool may_follow = is_key || decodable_.contains(subscription);
    if (!may_follow || waiting >= kPictureCountMax || is_too_much) {
      decodable_.erase(subscription);
      ++dropped_count_;
      return;
    }
    // Subscriptions that have ended are forgotten here, too; others go on with a key frame.
    if (decodable_.size() >= kDataCountMax) decodable_.clear();
    decodable_.insert(subscription);
    picture_byte_count_ += size;
    pictures_.push_back({subscription, std::move(frame)});
  }
  /// @return false if it is full; the caller then disconnects the client
  [[nodiscard]] bool push_control(OutgoingFrame frame) {
    const std::size_t size = size_of(frame);
    const bool is_too_much = control_byte_count_ + size > kControlByteMax && !control_.empty();
    if (control_.size() >= kControlCountMax || is_too_much) return false;
    control_byte_count_ += size;
    control_.push_back(std::move(frame));
    return true;
  }
  /// The next frame to send; control frames first.
  [[nodiscard]] std::optional<OutgoingFrame> pop() {
    if (!control_.empty()) {
      OutgoingFrame frame = std::move(control_.front());
      control_.pop_front();
      control_byte_count_ -= size_of(frame);
      return frame;
    }
    if (data_.empty()) return pop_picture();
    OutgoingFrame frame = std::move(data_.front());
    data_byte_count_ -= size_of(frame);
    data_.pop_front();
    return frame;
  }
  [[nodiscard]] std::uint64_t dropped_count() const noexcept { return dropped_count_; }

 private:
  struct Picture {
    std::uint32_t subscription = 0;
    OutgoingFrame frame{};
  };
  void drop_pictures(std::uint32_t subscription) {
    dropped_count_ += std::erase_if(pictures_, [&](const Picture& one) {
      if (one.subscription != subscription) return false;
      picture_byte_count_ -= size_of(one.frame);
      return true;
    });
  }
  [[nodiscard]] std::optional<OutgoingFrame> pop_picture() {
    if (pictures_.empty()) return std::nullopt;
    OutgoingFrame frame = std::move(pictures_.front().frame);
    picture_byte_count_ -= size_of(frame);
    pictures_.pop_front();
    return frame;
  }
  [[nodiscard]] static std::size_t size_of(const OutgoingFrame& frame) noexcept {
    return frame.head_size + (frame.body ? frame.body->size() : 0);
  }

  std::size_t data_byte_max_;
  std::deque<OutgoingFrame> control_{};
  std::size_t control_byte_count_ = 0;
  std::deque<OutgoingFrame> data_{};
  std::size_t data_byte_count_ = 0;
  std::deque<Picture> pictures_{};
  std::size_t picture_byte_count_ = 0;
  std::set<std::uint32_t> decodable_{};  ///< Subscriptions that got all since a key frame.
  std::uint64_t dropped_count_ = 0;
};

}  // namespace rtpm::console
