#include "objects/unbound.hpp"

#include <utility>

#include "rtpm/dynamic/remote_object.hpp"

namespace rtpm::tool {

SetupError with_similar_names(Context& context, const std::string& target, SetupError error) {
  auto url = dynamic::url_of(context.node(), context.registry, target);
  return url ? std::move(error) : std::move(url.error());
}

}  // namespace rtpm::tool
