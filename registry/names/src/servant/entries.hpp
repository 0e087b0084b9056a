#pragma once

#include <cstdint>

#include "model/idl.hpp"
#include "model/record.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/storage.hpp"
#include "rtpm/rpc/servant.hpp"

namespace rtpm::names {

[[nodiscard]] inline Duration lease_left(const Record& record, MonotonicTime now) noexcept {
  if (record.is_permanent()) return Duration::max();
  // A shared storage knows of later renewals at other registries.
  return record.expires > now ? record.expires - now : record.stay;
}

/// Whether a name was bound from a host other than the caller's, as far as both are known.
[[nodiscard]] constexpr bool is_other_host(std::uint64_t host, std::uint64_t caller_host) noexcept {
  return host != 0 && caller_host != 0 && host != own_host_as_one(caller_host);
}

/// How much of a record a caller receives.
enum class EntryDetail : std::uint8_t { kBrief, kHost, kAll };

/// Encodes a record for a caller.
[[nodiscard]] inline flatbuffers::Offset<Entry> write_entry(flatbuffers::FlatBufferBuilder& builder,
                                                            const Record& record, MonotonicTime now,
                                                            std::uint64_t caller_host,
                                                            EntryDetail detail) {
  const auto name = builder.CreateString(record.name);
  const auto url = builder.CreateString(record.url);
  const auto interface = builder.CreateString(record.interface);
  flatbuffers::Offset<PropertyTables> properties{};
  if (detail == EntryDetail::kAll) properties = write_properties(builder, record.properties);
  flatbuffers::Offset<flatbuffers::String> bound_from{};
  const bool is_host_known = record.host != 0 && record.host != kLoopbackElsewhere;
  if (detail != EntryDetail::kBrief && is_host_known) {
    bound_from = builder.CreateString(to_string(rpc::CallerHost{record.host}));
  }
  return CreateEntry(builder, name, url, interface, ns_of(lease_left(record, now)), record.revision,
                     properties, record.is_permanent(), bound_from,
                     is_other_host(record.host, caller_host));
}

}  // namespace rtpm::names
