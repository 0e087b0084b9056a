#pragma once

#include <array>
#include <cstddef>
#include <cstring>

#include "wrench.rtpm.hpp"

/// The counted work of generated code.
namespace rtpm::bench::micro {

class Tip final : public TipServant {
 public:
  rpc::Result<Wrench> exchange(const Wrench& request, const rpc::CallContext&) override {
    return Wrench(request.fx() + 1, request.fy(), request.fz(), request.tx(), request.ty(),
                  request.tz());
  }
};

inline const rpc::CallContext kContext{
    .priority = 0, .deadline = kNever, .received = {}, .trace_id = 0};

/// A call of 48 bytes as the stub encodes it, the skeleton dispatches it and the stub decodes its
/// reply, with nothing between; false if it failed.
struct GeneratedCall {
  alignas(16) std::array<std::byte, 64> request{};
  alignas(16) std::array<std::byte, 64> reply{};
  Wrench wrench{1, 2, 3, 4, 5, 6};

  bool run(rpc::Servant& servant) {
    // The stub's side: the request's bytes go into the transport's memory.
    const ConstBytes bytes = rpc::struct_bytes(wrench);
    std::memcpy(request.data(), bytes.data(), bytes.size());
    asm volatile("" : : : "memory");
    const rpc::DispatchResult result =
        servant.dispatch(1, {request.data(), bytes.size()}, reply, kContext);
    if (result.reply_size != sizeof wrench) return false;
    std::memcpy(&wrench, reply.data(), sizeof wrench);
    return true;
  }
};

}  // namespace rtpm::bench::micro
