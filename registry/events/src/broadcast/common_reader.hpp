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

/// A consumer's place at a common reader. Whoever has claimed it, the consumer's own thread or the
/// reader's, may read for the consumer and call its handler; the other waits, or passes.
/// @threads  those two
class ReaderSeat {
 public:
  /// What the reader serves.
  class Member {
   public:
    enum class Taking : std::uint8_t {
      kDelivered,
      kNothing,
      kApart,  ///< Nothing, and its own thread is to go on.
    };
    virtual ~Member() = default;
    /// Takes one delivery and hands it over. Called with the seat claimed.
    [[nodiscard]] virtual Taking take_one() noexcept = 0;
  };

  ReaderSeat(Member& member, std::uint32_t wake_bits) noexcept
      : member_(member), wake_bits_(wake_bits) {}

  /// The consumer's own thread: waits while the reader has it.
  void claim() noexcept;
  /// The reader: false if the consumer's own thread has it, which then looks again by itself.
  [[nodiscard]] bool try_claim() noexcept;
  /// Whether the other looked in between, so that there may be more to do.
  [[nodiscard]] bool release() noexcept;
  /// The consumer's own thread rests until it is called, or until `until`.
  void rest(MonotonicTime until) noexcept { static_cast<void>(call_.wait_until(until)); }
  void call() noexcept { call_.post(); }

  // With the seat claimed:

  [[nodiscard]] Member& member() noexcept { return member_; }
  /// Whether the reader serves it; else the consumer's own thread does.
  [[nodiscard]] bool is_common() const noexcept { return is_common_; }
  void set_common(bool is_common) noexcept { is_common_ = is_common; }
  /// A handler took so long: those who do so often, or very long, are to be served apart.
  void note_duration(Duration duration, MonotonicTime now) noexcept;
  /// It kept others waiting.
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

/// A thread that reads for several consumers of one program, source, priority and set of CPUs,
/// so that an event wakes one thread and not each of theirs: to wake a thread and have it sleep
/// again takes some µs, longer than most handlers do.
///
/// No consumer is to wait for another's handler. A second thread, the guard, wakes with the first,
/// and looks whether that is still in one and the same handler 0.1 ms later. If so, each consumer's
/// own thread serves it until the handler has returned. A consumer whose handler was slow is served
/// by its own thread until it was quick for 1 to 10 s.
///
/// What must be fetched from its source, such as a multicast, the reader fetches, and the guard
/// where the reader does not serve.
/// @ownership its threads; consumers share it
class CommonReader {
 public:
  /// So many consumers are worth it where nothing needs to be fetched.
  static constexpr std::size_t kSeatCountMin = 2;
  static constexpr std::size_t kSeatCountMax = 1024;
  /// A handler is slow that often takes longer than the first, or once longer than the second.
  static constexpr Duration kQuickMax = std::chrono::microseconds{100};
  static constexpr Duration kTooLong = std::chrono::milliseconds{2};
  /// For how long at first, and at most if it turns slow again soon.
  static constexpr Duration kSlowSpanFirst = std::chrono::seconds{1};
  static constexpr Duration kSlowSpanMax = std::chrono::seconds{10};

  /// Whom one reader can serve.
  struct Key {
    const void* node = nullptr;
    std::uint64_t broadcast = 0;  ///< The ring's or multicast's id.
    std::string interface {};     ///< Where a multicast is received.
    std::optional<Priority> priority{};
    std::vector<int> cpus{};
    rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
    friend bool operator==(const Key&, const Key&) = default;
  };
  using MakeSource = std::function<std::shared_ptr<ReaderSource>()>;
  /// The program's reader for `key`; where there is none, one is made with a source of the key's.
  /// Null: there is no source, or it must be fetched and the system gives no threads for that.
  /// @realtime set-up only
  [[nodiscard]] static std::shared_ptr<CommonReader> of(const Key& key, const MakeSource& make);
  CommonReader(const CommonReader&) = delete;
  CommonReader& operator=(const CommonReader&) = delete;
  ~CommonReader();

  /// Takes a consumer in, or lets it go. By the consumer's own thread, with the seat claimed and
  /// not common.
  /// @realtime set-up only
  void join(const std::shared_ptr<ReaderSeat>& seat);
  void leave(const std::shared_ptr<ReaderSeat>& seat);
  [[nodiscard]] const std::shared_ptr<ReaderSource>& source() const noexcept { return source_; }
  /// Whether it serves now: else all are served by their own threads.
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
  /// Of what follows; never held while a handler runs.
  rt::PiMutex mutex_;
  std::vector<std::shared_ptr<ReaderSeat>> seats_{};
  bool has_failed_ = false;  ///< It got no threads.
  bool is_dispersed_ = false;

  std::atomic<std::uint64_t> version_{1};  ///< Of seats_.
  std::atomic<bool> serves_{false};
  std::atomic<std::uint32_t> wake_bits_{0};
  std::atomic<bool> is_stopping_{false};
  /// Counts the begins and ends of calls to handlers: odd while one runs.
  std::atomic<std::uint64_t> call_{0};
  /// What the source said before the last pass, which found nothing.
  std::atomic<std::uint32_t> done_{0};
  // The reader's thread.
  std::vector<std::shared_ptr<ReaderSeat>> served_{};
  std::uint64_t served_version_ = 0;
  MonotonicTime last_time_{};

  rt::Semaphore lead_call_{};  ///< They rest there while it does not serve.
  rt::Semaphore guard_call_{};
  rt::Thread lead_{};
  rt::Thread guard_{};
};

}  // namespace rtpm::events
