#include "model/watch_filter.hpp"

#include <string_view>

#include "model/properties.hpp"
#include "model/record.hpp"
#include "rtpm/names/policy.hpp"

namespace rtpm::names {
namespace {

bool is_in(std::string_view name, std::string_view directory) {
  if (directory.empty() || name == directory) return true;
  return name.size() > directory.size() && name.starts_with(directory) &&
         name[directory.size()] == '/';
}

}  // namespace

bool WatchFilter::accepts(const Record& record) const {
  if (!is_in(record.name, directory)) return false;
  if (!names.empty() && !names.contains(record.name)) return false;
  if (!interface.empty() && interface != record.interface) return false;
  if (!may_see(caller.get(), record.name)) return false;
  return predicate.accepts(RecordProperties(record));
}

}  // namespace rtpm::names
