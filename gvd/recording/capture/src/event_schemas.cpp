#include "rtpm/capture/event_schemas.hpp"

namespace rtpm::capture {

schema::Dynamic* EventSchemas::find(const events::EventDescriptor* type) {
  if (type == nullptr || type->schema.empty()) return nullptr;
  const auto [found, is_new] = entries_.try_emplace(type->type);
  Entry& entry = found->second;
  // Remembers a schema that can't be read, too, so that it is not read again.
  if (is_new || entry.schema_id != type->schema_id) {
    std::string error;
    entry = {type->schema_id,
             schema::Dynamic::make_for_event(std::string(type->schema), type->name, error)};
  }
  return entry.dynamic.get();
}

std::string type_text(events::EventType type, const events::EventDescriptor* known) {
  if (known != nullptr) return std::string(known->name);
  if (type == events::kTimeoutType) return "timeout";
  if (type == events::kLinkType) return "link";
  return std::to_string(type);
}

}  // namespace rtpm::capture
