#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <type_traits>

namespace rtpm::inline base {

/// Latest's default pause between two steps of a write: none. A test's own type stops the writer
/// there.
struct LatestNoPause {
  static void pause() noexcept {}
};

/// The newest value of a state that one real-time thread writes and other threads read, such as a
/// device's sample. Neither side waits for the other: the writer fills the oldest slot, then
/// publishes it. If the writer is preempted or killed during a write, the previous value stays
/// readable. A reader retries only if kSlotCount − 1 writes overtook it while it copied a value.
/// @ownership holds kSlotCount values in place
/// @threads  write() from one thread; read() from any
/// @realtime write() is wait-free; read() copies once, and at most kReadAttemptMax times
template <class T, class Pause = LatestNoPause>
requires std::is_trivially_copyable_v<T>
class Latest {
 public:
  static constexpr std::size_t kSlotCount = 4;
  static constexpr int kReadAttemptMax = 1024;

  void write(const T& value) noexcept {
    std::array<std::uint64_t, kWordCount> words{};
    std::memcpy(words.data(), &value, sizeof value);
    const std::uint64_t number = newest_.load(std::memory_order_relaxed) + 1;
    Slot& slot = slots_[number % kSlotCount];
    // SYNC POINT latest-begin: the number announces that the words will change; each word is
    // released after it.
    slot.number.store(number, std::memory_order_relaxed);
    Pause::pause();
    for (std::size_t i = 0; i < kWordCount; ++i) {
      slot.words[i].store(words[i], std::memory_order_release);
      Pause::pause();
    }
    // SYNC POINT latest-end: the words of this number belong together.
    newest_.store(number, std::memory_order_release);
  }

  /// The newest complete value; nullopt if there is none yet, or if writes overtook the reader
  /// kReadAttemptMax times in a row.
  [[nodiscard]] std::optional<T> read() const noexcept {
    for (int attempt = 0; attempt < kReadAttemptMax; ++attempt) {
      // SYNC POINT latest-end
      const std::uint64_t number = newest_.load(std::memory_order_acquire);
      if (number == 0) return std::nullopt;
      const Slot& slot = slots_[number % kSlotCount];
      std::array<std::uint64_t, kWordCount> words;
      for (std::size_t i = 0; i < kWordCount; ++i) {
        // SYNC POINT latest-begin: a reader that sees a newer word also sees the newer number.
        words[i] = slot.words[i].load(std::memory_order_acquire);
      }
      if (slot.number.load(std::memory_order_relaxed) != number) continue;
      T value;
      std::memcpy(static_cast<void*>(&value), words.data(), sizeof value);
      return value;
    }
    return std::nullopt;
  }

  /// The number of values written.
  [[nodiscard]] std::uint64_t count() const noexcept {
    return newest_.load(std::memory_order_acquire);
  }

 private:
  static constexpr std::size_t kWordCount = (sizeof(T) + 7) / 8;

  /// Has its own cache lines, so that writes to other slots do not disturb its reader.
  struct alignas(64) Slot {
    std::atomic<std::uint64_t> number{0};
    std::array<std::atomic<std::uint64_t>, kWordCount> words{};
  };

  /// The number of the newest complete value; 0 if there is none.
  alignas(64) std::atomic<std::uint64_t> newest_{0};
  std::array<Slot, kSlotCount> slots_{};
};

}  // namespace rtpm::inline base
