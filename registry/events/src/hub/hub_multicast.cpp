#include <algorithm>
#include <cstdint>
#include <vector>

#include "hub/hub_impl.hpp"
#include "rtpm/rt/memory.hpp"

// The hub's side of its multicast.
namespace rtpm::events {
namespace {

// The size of one reply; a consumer that misses more asks again.
constexpr std::size_t kRepairSizeMax = std::size_t{32} * 1024;
constexpr std::size_t kSizeSize = 4;

}  // namespace

rpc::Result<void> HubImpl::multicast(rpc::ReplyBuilder<MulticastReply>& reply,
                                     const rpc::CallContext&) {
  const rt::AllowAllocationScope is_allowed;
  auto& builder = reply.builder();
  if (!multicast_) {
    reply.finish(CreateMulticastReply(builder));
    return {};
  }
  const auto group = builder.CreateString(multicast_->group().group);
  reply.finish(CreateMulticastReply(builder, multicast_->id(), group, multicast_->group().port));
  return {};
}

// ev-7.3-1 and ev-7.3-2
rpc::Result<void> HubImpl::repair(const RepairWish& missing, rpc::ReplyBuilder<RepairReply>& reply,
                                  const rpc::CallContext&) {
  const rt::AllowAllocationScope is_allowed;
  std::vector<std::uint8_t> datagrams(kRepairSizeMax);
  std::size_t size = 0;
  RepairFacts facts;
  {
    const std::lock_guard lock(mutex_);
    const auto number = find(missing.subscription());
    if (!number || !receives_multicast(*number)) return unexpected{rpc::Refusal::kGone};
    const MulticastWriter& writer = multicast_->writer();
    facts = RepairFacts(writer.oldest_sequence(), writer.next_sequence(),
                        multicast_->written_count(*number));
    for (std::uint64_t i = 0; i <= 64; ++i) {
      if (i > 0 && (missing.later() >> (i - 1) & 1) == 0) continue;
      const ConstBytes datagram = writer.datagram(missing.first() + i);
      if (datagram.empty()) continue;
      if (size + kSizeSize + datagram.size() > datagrams.size()) break;
      std::byte* const to = std::as_writable_bytes(std::span(datagrams)).data() + size;
      store_le(to, static_cast<std::uint32_t>(datagram.size()));
      std::copy(datagram.begin(), datagram.end(), to + kSizeSize);
      size += kSizeSize + datagram.size();
    }
  }
  auto& builder = reply.builder();
  const auto bytes = builder.CreateVector(datagrams.data(), size);
  reply.finish(CreateRepairReply(builder, &facts, bytes));
  return {};
}

}  // namespace rtpm::events
