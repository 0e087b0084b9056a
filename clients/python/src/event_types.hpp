#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/events/scalar.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::python {

/// An event's descriptor, made from its schema instead of by generated code.
/// @ownership owns all that the descriptor views
struct EventTypeOf {
  std::string name{};
  std::string schema{};
  std::deque<std::string> field_names{};
  std::vector<events::FieldDescriptor> fields{};
  events::EventDescriptor descriptor{};
};

/// The descriptor of the event that is one of the model's objects.
[[nodiscard]] std::unique_ptr<EventTypeOf> event_type_of(const schema::Model& model,
                                                         std::size_t object);

}  // namespace rtpm::python
