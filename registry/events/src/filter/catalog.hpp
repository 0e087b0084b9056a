#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "filter/descriptor_source.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/scalar.hpp"

namespace rtpm::events {

/// Limits of a catalog.
struct CatalogLimits {
  std::size_t type_count_max = 1024;
  std::size_t field_count_max = 256;        ///< Fields per type.
  std::size_t name_size_max = 200;          ///< Bytes of any name.
  std::size_t schema_size_max = 16 * 1024;  ///< In bytes; a longer schema is not stored.
};

/// The event types that suppliers and consumers have registered, for compiling filters.
/// @ownership copies the descriptors
/// @realtime set-up only
class TypeCatalog final : public DescriptorSource {
 public:
  explicit TypeCatalog(const CatalogLimits& limits = {}) : limits_(limits) {}

  /// Registers a type; repeating it has no effect.
  /// @errors   described in words: the type is registered with another schema (update the older
  ///           program), an invalid type or field path, a limit
  [[nodiscard]] expected<void, SetupError> add(const EventDescriptor& descriptor);

  [[nodiscard]] const EventDescriptor* find(EventType type) const noexcept override;
  /// All types, ordered by number; they live as long as the catalog.
  [[nodiscard]] std::vector<const EventDescriptor*> list() const;
  [[nodiscard]] std::size_t size() const noexcept { return types_.size(); }

 private:
  /// A descriptor with the data that it refers to.
  struct Owned {
    std::string name{};
    std::string schema{};
    std::vector<std::string> field_names{};
    std::vector<FieldDescriptor> fields{};
    EventDescriptor descriptor{};
  };
  CatalogLimits limits_;
  std::map<EventType, std::unique_ptr<Owned>> types_{};
};

}  // namespace rtpm::events
