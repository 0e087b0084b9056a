#include "objects/unbound.hpp"

#include <utility>

#include "objects/entries.hpp"
#include "rtpm/names/directory.hpp"

namespace rtpm::tool {

SetupError with_similar_names(Context& context, const std::string& target, SetupError error) {
  auto url = names::url_of(context.node(), context.registry, target);
  if (url) return error;
  return with_loss(context, target, std::move(url.error()));
}

SetupError with_loss(Context& context, const std::string& name, SetupError error) {
  for (const names::LapsedName& each : lost_names(context, {})) {
    if (each.name != name) continue;
    return {"'" + name + "' is " + lost_text(each) + ", was at " + each.url,
            "its lease ended, as its server hangs, is dead, or is cut off",
            "look after the server; `rtpm unbind " + name + "` dismisses the name"};
  }
  return error;
}

}  // namespace rtpm::tool
