#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "filter/descriptor_source.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/events/scalar.hpp"

namespace rtpm::events {

/// What a catalog takes in.
struct CatalogLimits {
  std::size_t type_count_max = 1024;
  std::size_t field_count_max = 256;  ///< Of one type.
  std::size_t name_size_max = 200;    ///< Bytes of any name.
};

/// The types of events that suppliers and consumers have told of, so that filters can be checked
/// against them. Generated code tells its types by itself; tools take them from a schema.
/// @ownership copies what it is told
/// @threads  one at a time
/// @realtime set-up only
class TypeCatalog final : public DescriptorSource {
 public:
  explicit TypeCatalog(const CatalogLimits& limits = {}) : limits_(limits) {}

  /// Takes a type in; the same again changes nothing.
  /// @errors   another schema of that type is known (update the older program), a number that is no
  ///           type's, a path that leads nowhere, a limit
  [[nodiscard]] expected<void, std::string> add(const EventDescriptor& descriptor);

  [[nodiscard]] const EventDescriptor* find(EventType type) const noexcept override;
  [[nodiscard]] std::size_t size() const noexcept { return types_.size(); }

 private:
  /// A descriptor and what it refers to.
  struct Owned {
    std::string name{};
    std::vector<std::string> field_names{};
    std::vector<FieldDescriptor> fields{};
    EventDescriptor descriptor{};
  };
  CatalogLimits limits_;
  std::map<EventType, std::unique_ptr<Owned>> types_{};
};

}  // namespace rtpm::events
