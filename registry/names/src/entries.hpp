#pragma once

#include "idl.hpp"
#include "rtpm/base/time.hpp"
#include "store.hpp"

namespace rtpm::names {

[[nodiscard]] inline Duration lease_left(const Record& record, MonotonicTime now) noexcept {
  if (record.is_permanent()) return Duration::max();
  // A shared storage knows of later renewals, at other registries.
  return record.expires > now ? record.expires - now : record.stay;
}

/// A record as callers get it.
[[nodiscard]] inline flatbuffers::Offset<Entry> write_entry(flatbuffers::FlatBufferBuilder& builder,
                                                            const Record& record, MonotonicTime now,
                                                            bool has_properties = false) {
  const auto name = builder.CreateString(record.name);
  const auto url = builder.CreateString(record.url);
  const auto interface = builder.CreateString(record.interface);
  flatbuffers::Offset<PropertyTables> properties{};
  if (has_properties) properties = write_properties(builder, record.properties);
  return CreateEntry(builder, name, url, interface, ns_of(lease_left(record, now)), record.revision,
                     properties, record.is_permanent());
}

}  // namespace rtpm::names
