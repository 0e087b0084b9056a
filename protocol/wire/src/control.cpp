#include "rtpm/wire/control.hpp"

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {
namespace {

constexpr std::uint8_t kBindServerDeclared = 1;
constexpr std::uint8_t kBindListComplete = 2;
constexpr std::uint8_t kBindFlagsKnown = kBindServerDeclared | kBindListComplete;

}  // namespace

std::size_t encode(const BindRequest& request, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(request.fingerprint);
  writer.put_text(request.path);
  writer.put_text(request.interface);
  return writer.ok() && request.path.size() <= kPathSizeMax ? writer.size() : 0;
}

std::optional<BindRequest> decode_bind_request(ConstBytes payload) noexcept {
  ByteReader reader(payload);
  BindRequest request;
  request.fingerprint = reader.take<std::uint64_t>();
  request.path = reader.take_text();
  request.interface = reader.take_text();
  if (!reader.ok() || reader.left() != 0 || request.path.size() > kPathSizeMax) {
    return std::nullopt;
  }
  return request;
}

void encode(const BindReply& reply, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(reply.service);
  writer.put(reply.priority.value());
  writer.put(static_cast<std::uint8_t>((reply.is_server_declared ? kBindServerDeclared : 0) |
                                       (reply.is_method_list_complete ? kBindListComplete : 0)));
  writer.put(std::uint8_t{0});
  writer.put(reply.fingerprint);
  writer.put(reply.method_count);
  writer.put_zeros(6);
  RTPM_ASSERT(writer.ok() && writer.size() == BindReply::kSize, "a bind reply has its size");
}

void encode(const MethodEntry& entry, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(entry.id);
  writer.put(std::uint16_t{0});
  writer.put(entry.fingerprint);
  RTPM_ASSERT(writer.ok(), "a method entry has its size");
}

// hp-6.1-5
std::optional<BindReply> decode_bind_reply(ConstBytes payload) noexcept {
  ByteReader reader(payload);
  BindReply reply;
  reply.service = reader.take<std::uint32_t>();
  const auto priority = reader.take<std::uint16_t>();
  const auto flags = reader.take<std::uint8_t>();
  bool is_reserved_zero = reader.take_zeros(1);
  reply.fingerprint = reader.take<std::uint64_t>();
  reply.method_count = reader.take<std::uint16_t>();
  is_reserved_zero = reader.take_zeros(6) && is_reserved_zero;
  if (!reader.ok() || !is_reserved_zero || !Priority::is_valid(priority) ||
      (flags & ~kBindFlagsKnown) != 0 || reply.service == kSessionService ||
      reader.left() != reply.method_count * MethodEntry::kSize) {
    return std::nullopt;
  }
  for (std::uint16_t i = 0; i < reply.method_count; ++i) {
    (void)reader.take<std::uint16_t>();
    if (!reader.take_zeros(2)) return std::nullopt;
    (void)reader.take<std::uint32_t>();
  }
  reply.priority = Priority{priority};
  reply.is_server_declared = (flags & kBindServerDeclared) != 0;
  reply.is_method_list_complete = (flags & kBindListComplete) != 0;
  return reply;
}

void encode_describe_request(std::uint32_t service, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(service);
  RTPM_ASSERT(writer.ok(), "a describe request has its size");
}

// hp-6.3-1
std::optional<std::uint32_t> decode_describe_request(ConstBytes payload) noexcept {
  if (payload.size() != kDescribeRequestSize) return std::nullopt;
  return ByteReader(payload).take<std::uint32_t>();
}

MethodEntry method_entry(ConstBytes bind_reply, std::uint16_t index) noexcept {
  ByteReader reader(bind_reply.subspan(BindReply::kSize + index * MethodEntry::kSize));
  MethodEntry entry;
  entry.id = reader.take<std::uint16_t>();
  (void)reader.take<std::uint16_t>();
  entry.fingerprint = reader.take<std::uint32_t>();
  return entry;
}

}  // namespace rtpm::wire
