#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "broadcast/reader_source.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::events {

/// A consumer's seat at a common reader. The thread that has claimed it, either the consumer's own
/// or the reader's, reads for the consumer and calls its handler; the other thread waits or skips.
/// @threads  the consumer's own and the reader's
class ReaderSeat {
 public:
  /// The consumer, as the reader sees it.
  class Member {
   public:
    enum class Taking : std::uint8_t {
      kDelivered,
      kNothing,
      kApart,  ///< Nothing; the consumer's own thread continues.
    };
    virtual ~Member() = default;
    /// Passes one delivery to the handler. Requires that the seat is claimed.
    [[nodiscard]] virtual Taking take_one() noexcept = 0;
  };

  ReaderSeat(Member& member, std::uint32_t wake_bits) noexcept
      : member_(member), wake_bits_(wake_bits) {}

  /// Claims the seat for the consumer's own thread; waits for the reader.
  void claim() noexcept;
  /// Claims the seat for the reader. False if the consumer's thread has it, which then checks for
  /// more.
  [[nodiscard]] bool try_claim() noexcept;
  /// Releases the seat. Returns whether the other thread tried to claim it: there may be more to
  /// do.
  [[nodiscard]] bool release() noexcept;
  /// Lets the consumer's own thread sleep until call() or `until`.
  void rest(MonotonicTime until) noexcept { static_cast<void>(call_.wait_until(until)); }
  void call() noexcept { call_.post(); }

  // The functions below require the claimed seat.

  [[nodiscard]] Member& member() noexcept { return member_; }
  /// Whether the reader serves the seat instead of the consumer's own thread.
  [[nodiscard]] bool is_common() const noexcept { return is_common_; }
  void set_common(bool is_common) noexcept { is_common_ = is_common; }
  /// Records how long a handler ran; frequent or very long runs make the seat slow.
  void note_duration(Duration duration, MonotonicTime now) noexcept;
  /// Marks the seat slow: the consumer's own thread serves it.
  void set_slow(MonotonicTime now) noexcept;
  [[nodiscard]] bool is_slow(MonotonicTime now) const noexcept { return now < slow_until_; }

  [[nodiscard]] std::uint32_t wake_bits() const noexcept { return wake_bits_; }

 private:
  Member& member_;
  std::uint32_t wake_bits_;
  std::atomic<std::uint32_t> state_{0};
  rt::Semaphore call_{};
  bool is_common_ = false;
  int slowness_ = 0;
  Duration slow_span_{};
  MonotonicTime slow_until_ = MonotonicTime::min();
};

/// A thread that reads for several consumers with the same program, source, priority and CPUs, so
/// that an event wakes one thread instead of many: a wake-up takes some µs, longer than most
/// handlers.
///
/// No consumer waits long for another one's handler. A second thread, the guard, wakes with the
/// first and checks after 0.1 ms whether that is still in the same handler. If so, the consumers'
/// own threads take over until the handler returns. The consumer of a slow handler keeps its own
/// thread until the handler has been quick for 1 to 10 s.
///
/// The reader also fetches from sources that need it, such as multicast; when it does not serve,
/// the guard does.
/// @ownership its threads; consumers share it
class CommonReader {
 public:
  /// The fewest consumers worth a reader, unless the source must be fetched.
  static constexpr std::size_t kSeatCountMin = 2;
  static constexpr std::size_t kSeatCountMax = 1024;
  /// A handler is slow if it often exceeds the first limit, or once exceeds the second.
  static constexpr Duration kQuickMax = std::chrono::microseconds{100};
  static constexpr Duration kTooLong = std::chrono::milliseconds{2};
  /// How long a seat stays slow: the first time, and at most when this recurs soon.
  static constexpr Duration kSlowSpanFirst = std::chrono::seconds{1};
  static constexpr Duration kSlowSpanMax = std::chrono::seconds{10};

  /// Consumers with equal keys share a reader.
  struct Key {
    const void* node = nullptr;
    std::uint64_t broadcast = 0;  ///< Id of the ring or multicast.
    std::string interface {};     ///< Interface of a multicast.
    std::optional<Priority> priority{};
    std::vector<int> cpus{};
    rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
    friend bool operator==(const Key&, const Key&) = default;
  };
  using MakeSource = std::function<std::shared_ptr<ReaderSource>()>;
  /// The program's reader for `key`, created on demand. Null if there is no source, or if no
  /// threads could start for a source that must be fetched.
  /// @realtime set-up only
  [[nodiscard]] static std::shared_ptr<CommonReader> of(const Key& key, const MakeSource& make);
  CommonReader(const CommonReader&) = delete;
  CommonReader& operator=(const CommonReader&) = delete;
  ~CommonReader();

  /// Adds or removes a consumer. Call it on the consumer's own thread, with the seat claimed and
  /// not common.
  /// @realtime set-up only
  void join(const std::shared_ptr<ReaderSeat>& seat);
  void leave(const std::shared_ptr<ReaderSeat>& seat);
  [[nodiscard]] const std::shared_ptr<ReaderSource>& source() const noexcept { return source_; }
  /// Whether the common reader serves its consumers; otherwise their own threads do.
  [[nodiscard]] bool serves() const noexcept { return serves_.load(std::memory_order_acquire); }

 private:
  CommonReader(Key key, std::shared_ptr<ReaderSource> source);
  [[nodiscard]] bool start_threads();
  void decide();
  void lead() noexcept;
  void take_over_seats() noexcept;
  [[nodiscard]] bool pass() noexcept;
  [[nodiscard]] bool serve(ReaderSeat& seat) noexcept;
  [[nodiscard]] bool gather(ReaderSeat* slow, MonotonicTime now) noexcept;
  void guard() noexcept;
  void disperse(std::uint64_t call) noexcept;

  const Key key_;
  const std::shared_ptr<ReaderSource> source_;
  /// Guards the members below; never held while a handler runs.
  rt::PiMutex mutex_;
  std::vector<std::shared_ptr<ReaderSeat>> seats_{};
  bool has_failed_ = false;  ///< Its threads could not start.
  bool is_dispersed_ = false;

  std::atomic<std::uint64_t> version_{1};  ///< Version of seats_.
  std::atomic<bool> serves_{false};
  std::atomic<std::uint32_t> wake_bits_{0};
  std::atomic<bool> is_stopping_{false};
  /// Counts starts and ends of handler calls: odd while one runs.
  std::atomic<std::uint64_t> call_{0};
  /// The source's value() before the last pass without a delivery.
  std::atomic<std::uint32_t> done_{0};
  // Used by the reader's thread only.
  std::vector<std::shared_ptr<ReaderSeat>> served_{};
  std::uint64_t served_version_ = 0;
  MonotonicTime last_time_{};

  rt::Semaphore lead_call_{};  ///< Wakes the reader's thread when it must serve.
  rt::Semaphore guard_call_{};
  rt::Thread lead_{};
  rt::Thread guard_{};
};

}  // namespace rtpm::events
