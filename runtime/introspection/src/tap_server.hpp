#pragma once

#include <atomic>
#include <introspection.rtpm.hpp>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/rpc/tap.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::introspection {

/// Streams the calls of a server to one client at a time. Its own thread, which sleeps without a
/// client, switches the tap on and off and reads it.
/// @threads  its methods: any lane; start() and the destructor: one
/// @realtime none
class TapServer final : public TapServant {
 public:
  explicit TapServer(std::shared_ptr<rpc::CallTap> tap) noexcept : tap_(std::move(tap)) {}
  ~TapServer() override;

  /// @errors  those of rt::Thread::start()
  [[nodiscard]] expected<void, SetupError> start();

  void tap(const TapRequest& request, rpc::TableWriter<TapBatch> items,
           const rpc::CallContext& context) override;

 private:
  struct Client {
    rpc::TapConfig config{};
    rpc::TableWriter<TapBatch> items{};
  };
  void run() noexcept;
  void serve(Client client) noexcept;
  [[nodiscard]] std::optional<Client> take_client() noexcept;
  void send_calls(rpc::TableWriter<TapBatch>& items) noexcept;
  [[nodiscard]] bool send(rpc::TableWriter<TapBatch>& items, bool is_first) noexcept;
  void collect(const rpc::TappedCall& call);

  std::shared_ptr<rpc::CallTap> tap_;
  rt::PiMutex mutex_{};
  std::optional<Client> arriving_{};  ///< Guarded by the mutex.
  std::atomic<bool> is_busy_{false};  ///< A client is being accepted or served.
  std::atomic<bool> is_ending_{false};
  rt::Semaphore wake_{};
  // Used by the thread only, like the next three members.
  std::vector<TappedCall> calls_{};
  std::vector<std::uint8_t> payloads_{};
  std::uint64_t too_large_count_ = 0;  ///< Calls in items that exceed the client's limit.
  flatbuffers::FlatBufferBuilder builder_{};
  rt::Thread thread_{};
};

}  // namespace rtpm::introspection
