#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <type_traits>

namespace rtpm::inline base {

/// The newest value of a state that one real-time thread writes and others read, such as a device's
/// sample. The writer never waits for a reader; a reader that is overtaken tries again.
/// Ownership: holds one value in place.   Threads: write() from one thread; read() from any.
/// RT: write() is wait-free; read() repeats only while a write overlaps it, at most kReadAttemptMax
/// times.
template <class T>
requires std::is_trivially_copyable_v<T>
class Latest {
 public:
  static constexpr int kReadAttemptMax = 1024;

  void write(const T& value) noexcept {
    std::array<std::uint64_t, kWordCount> words{};
    std::memcpy(words.data(), &value, sizeof value);
    const std::uint64_t before = version_.load(std::memory_order_relaxed);
    // SYNC POINT latest-begin: an odd version says that the words are changing; each word is
    // released after it.
    version_.store(before + 1, std::memory_order_relaxed);
    for (std::size_t i = 0; i < kWordCount; ++i) {
      words_[i].store(words[i], std::memory_order_release);
    }
    // SYNC POINT latest-end: an even version says that the words belong together.
    version_.store(before + 2, std::memory_order_release);
  }

  /// The newest value, or nothing if none was written yet (or the writer died in the middle).
  [[nodiscard]] std::optional<T> read() const noexcept {
    for (int attempt = 0; attempt < kReadAttemptMax; ++attempt) {
      // SYNC POINT latest-end
      const std::uint64_t before = version_.load(std::memory_order_acquire);
      if (before == 0) return std::nullopt;
      if (before % 2 == 1) continue;
      std::array<std::uint64_t, kWordCount> words;
      for (std::size_t i = 0; i < kWordCount; ++i) {
        // SYNC POINT latest-begin: whoever sees a new word sees the odd version before it.
        words[i] = words_[i].load(std::memory_order_acquire);
      }
      if (version_.load(std::memory_order_relaxed) != before) continue;
      T value;
      std::memcpy(static_cast<void*>(&value), words.data(), sizeof value);
      return value;
    }
    return std::nullopt;
  }

  /// How many values were written.
  [[nodiscard]] std::uint64_t count() const noexcept {
    return version_.load(std::memory_order_acquire) / 2;
  }

 private:
  static constexpr std::size_t kWordCount = (sizeof(T) + 7) / 8;

  alignas(64) std::atomic<std::uint64_t> version_{0};
  std::array<std::atomic<std::uint64_t>, kWordCount> words_{};
};

}  // namespace rtpm::inline base
