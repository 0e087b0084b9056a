#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "filter/compiled_filter.hpp"

namespace rtpm::events {

/// "event type 7", with its name if it has one.
[[nodiscard]] std::string in_words(EventType type, const EventDescriptor* descriptor);

/// The field, or the reason why there is none, in words.
[[nodiscard]] expected<const FieldDescriptor*, SetupError> find_field(
    EventType type, std::string_view name, const DescriptorSource& types);

/// Compiles a tree into an array of nodes, children first.
class Compiler {
 public:
  explicit Compiler(const DescriptorSource& types) noexcept : types_(types) {}
  [[nodiscard]] expected<CompiledFilter, SetupError> compile(const Filter& filter);

 private:
  /// The properties of a compiled node that its parent needs.
  struct Made {
    std::size_t index = 0;
    std::size_t group_size = 1;  ///< The most events in one delivery.
    std::vector<Interest> interests{};
    bool is_decided_by_interest = false;
    bool keeps = false;        ///< It contains a conjunction.
    bool has_timeout = false;  ///< It contains a timeout.
    /// Silence timeouts whose group is the node's parent.
    std::vector<std::size_t> silences{};
  };
  using Result = expected<Made, SetupError>;
  using Children = std::vector<Made>;

  [[nodiscard]] Result make(const Filter& filter, const std::string& path, std::size_t depth);
  [[nodiscard]] Result make_match(const Filter& filter);
  [[nodiscard]] Result make_listed(const Filter& filter, const std::string& path);
  [[nodiscard]] Result make_where(const Filter& filter, const std::string& path);
  [[nodiscard]] Result make_timeout(const Filter& filter, const std::string& path);
  [[nodiscard]] Result make_group(const Filter& filter, const std::string& path,
                                  const Children& children);
  [[nodiscard]] static std::vector<Interest> interests_of(const Filter& filter,
                                                          const Children& children);
  void keep_for(CompiledFilter::Node& node, const Children& children);
  [[nodiscard]] std::size_t add(const CompiledFilter::Node& node);

  const DescriptorSource& types_;
  CompiledFilter compiled_{};
};

}  // namespace rtpm::events
