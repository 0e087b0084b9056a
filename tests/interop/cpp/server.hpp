#pragma once

#include <atomic>
#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "interop.rtpm.events.hpp"
#include "interop.rtpm.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::interop {

/// The servant of the matrix, see tests/interop/README.md.
/// @threads  one lane; streams and pauses have threads of their own
class Servant final : public InteropServant {
 public:
  /// @param hubs  where the hub "rtpm/events" is looked up
  explicit Servant(rpc::Node& hubs) : hubs_(hubs) {}
  ~Servant() override;

  rpc::Result<Numbers> echo_numbers(const Numbers& request, const rpc::CallContext&) override {
    return request;
  }
  rpc::Result<void> echo_values(const Values& request, rpc::ReplyBuilder<Values>& reply,
                                const rpc::CallContext& context) override;
  rpc::Result<void> echo_bytes(const Bytes& request, rpc::ReplyBuilder<Bytes>& reply,
                               const rpc::CallContext& context) override;
  rpc::Result<void> add(const Count& request, rpc::ReplyBuilder<Count>& reply,
                        const rpc::CallContext& context) override;
  rpc::Result<void> refuse(const Refusal& request, const rpc::CallContext& context) override;
  void wait(const Pause& request, rpc::DeferredNothing reply,
            const rpc::CallContext& context) override;
  rpc::Result<void> hold(const Pause& request, rpc::ReplyBuilder<Pausing>& reply,
                         const rpc::CallContext& context) override;
  rpc::Result<void> note_sent(const Note& request, const rpc::CallContext& context) override;
  rpc::Result<void> note_received(const Note& request, const rpc::CallContext& context) override;
  rpc::Result<void> note_done(const Note& request, const rpc::CallContext& context) override;
  rpc::Result<void> notes(rpc::ReplyBuilder<Notes>& reply,
                          const rpc::CallContext& context) override;
  void count_up(const Range& request, rpc::TableWriter<Item> items,
                const rpc::CallContext& context) override;
  rpc::Result<void> streams(rpc::ReplyBuilder<Count>& reply,
                            const rpc::CallContext& context) override;
  rpc::Result<void> priority(rpc::ReplyBuilder<Priority>& reply,
                             const rpc::CallContext& context) override;
  rpc::Result<void> emit(const Emission& request, const rpc::CallContext& context) override;

  /// Refuses with the text of a Refusal, which a method can't.
  rpc::DispatchResult dispatch(std::uint16_t method_id, ConstBytes request, MutableBytes reply,
                               const rpc::CallContext& context) override;

 private:
  rpc::Node& hubs_;
  std::atomic<std::uint32_t> sum_{0};
  std::atomic<std::uint32_t> note_count_{0};
  std::atomic<std::uint32_t> stream_count_{0};
  std::optional<MeasuredSupplier> supplier_{};  ///< Belongs to the lane's thread.
  std::mutex mutex_{};
  std::list<std::thread> threads_{};  ///< Guarded by `mutex_`; joined at the end.
  std::atomic<bool> is_ending_{false};
};

class OtherObject final : public OtherServant {
 public:
  rpc::Result<void> nothing(const rpc::CallContext&) override { return {}; }
};

}  // namespace rtpm::interop
