#pragma once

#include <vector>

#include "rtpm/schema/conform.hpp"

namespace rtpm::schema {

/// Compares tables, structs, enums and unions with the same name. Leaves the verdicts open, because
/// they depend on how the types are used.
class TypeComparison {
 public:
  TypeComparison(const Model& before, const Model& after, std::vector<Change>& changes)
      : before_(before), after_(after), changes_(changes) {}

  void compare(const Object& before, const Object& after);
  void compare(const Enum& before, const Enum& after);

 private:
  void report(ChangeKind kind, Reading reading, const std::string& owner, const Location& now,
              const Location& then, std::string message, std::string hint);
  void compare_structs(const Object& before, const Object& after);
  void compare_tables(const Object& before, const Object& after);
  bool compare_places(const Object& before, const Object& after);
  void compare_fields(const Object& owner, const Field& before, const Field& after);
  bool compare_types(const Object& owner, const Field& before, const Field& after);
  void compare_presence(const Object& owner, const Field& before, const Field& after);
  void compare_defaults(const Object& owner, const Field& before, const Field& after);
  void compare_meaning(const Object& owner, const Field& before, const Field& after);
  void add_field(const Object& owner, const Field& field);
  void remove_field(const Object& owner, const Field& field, const Object& now);

  struct ValueIndex;
  void compare_value(const Enum& owner, const EnumValue& before, const ValueIndex& old_values,
                     const ValueIndex& new_values);

  const Model& before_;
  const Model& after_;
  std::vector<Change>& changes_;
};

}  // namespace rtpm::schema
