#include "rtpm/schema/conform.hpp"

#include <map>
#include <set>
#include <string>
#include <utility>

#include "checks/conform_types.hpp"
#include "model/reach.hpp"
#include "model/spelling.hpp"

namespace rtpm::schema {
namespace {

/// Which parts use each type, by name.
struct Uses {
  std::set<std::string> in_requests{};
  std::set<std::string> in_replies{};
  /// Used in events, or a type of this file that no method uses.
  std::set<std::string> elsewhere{};

  void add(const Model& model) {
    Reach requests;
    Reach replies;
    Reach others;
    for (const Service& service : model.services) {
      for (const Method& method : service.methods) {
        requests.add(model, method.request.table);
        replies.add(model, method.reply.table);
      }
    }
    for (std::size_t i = 0; i < model.objects.size(); ++i) {
      const bool is_own = model.objects[i].declaration_file == model.declaration_file;
      const bool is_used = requests.objects.contains(i) || replies.objects.contains(i);
      if ((is_own && !is_used) || model.objects[i].event_id) others.add(model, i);
    }
    for (std::size_t i = 0; i < model.enums.size(); ++i) {
      const bool is_own = model.enums[i].declaration_file == model.declaration_file;
      if (is_own && !requests.enums.contains(i) && !replies.enums.contains(i))
        others.enums.insert(i);
    }
    add_names(model, requests, in_requests);
    add_names(model, replies, in_replies);
    add_names(model, others, elsewhere);
  }

  [[nodiscard]] bool contains(const std::string& name) const {
    return in_requests.contains(name) || in_replies.contains(name) || elsewhere.contains(name);
  }

 private:
  static void add_names(const Model& model, const Reach& reach, std::set<std::string>& names) {
    for (const std::size_t index : reach.objects)
      names.insert(model.objects[index].name);
    for (const std::size_t index : reach.enums)
      names.insert(model.enums[index].name);
  }
};

template <class T>
std::map<std::string, const T*> by_name(const std::vector<T>& things) {
  std::map<std::string, const T*> names;
  for (const T& thing : things)
    names.emplace(thing.name, &thing);
  return names;
}

class Comparison {
 public:
  Comparison(const Model& before, const Model& after) : before_(before), after_(after) {
    uses_.add(before);
    uses_.add(after);
  }

  std::vector<Change> run() {
    compare_types(before_.objects, after_.objects);
    compare_types(before_.enums, after_.enums);
    // A change of a type breaks its users; a change of a service already has its own verdict.
    for (Change& change : changes_)
      judge(change);
    compare_services();
    for (Change& change : changes_) {
      const bool is_shared = change.breaks_old_clients || uses_.elsewhere.contains(change.owner);
      if (is_shared && (change.breaks_old_clients || change.breaks_new_clients)) {
        change.verdict = Verdict::kIncompatible;
      } else if (change.breaks_new_clients) {
        change.verdict = Verdict::kServersFirst;
      }
    }
    return std::move(changes_);
  }

 private:
  void judge(Change& change) const {
    const Reading& reading = change.reading;
    const bool is_elsewhere = uses_.elsewhere.contains(change.owner);
    if (uses_.in_requests.contains(change.owner) || is_elsewhere) {
      change.breaks_old_clients |= !reading.new_reads_old;
      change.breaks_new_clients |= !reading.old_reads_new;
    }
    if (uses_.in_replies.contains(change.owner) || is_elsewhere) {
      change.breaks_old_clients |= !reading.old_reads_new;
      change.breaks_new_clients |= !reading.new_reads_old;
    }
  }

  template <class T>
  void compare_types(const std::vector<T>& before, const std::vector<T>& after) {
    const auto old_types = by_name(before);
    const auto new_types = by_name(after);
    TypeComparison comparison(before_, after_, changes_);
    for (const auto& [name, type] : old_types) {
      if (!uses_.contains(name)) continue;
      const auto now = new_types.find(name);
      if (now != new_types.end()) {
        comparison.compare(*type, *now->second);
      } else if (type->declaration_file == before_.declaration_file &&
                 uses_.elsewhere.contains(name)) {
        // If a method of this file used it, the method's own change reports it.
        add(ChangeKind::kTypeRemoved, name, type->location,
            "type `" + name + "` is removed, and other schemas may use it", "keep it");
        changes_.back().reading = {.new_reads_old = false, .is_by_meaning = true};
      }
    }
    for (const auto& [name, type] : new_types) {
      if (!old_types.contains(name) && uses_.contains(name)) {
        add(ChangeKind::kTypeAdded, name, type->location, "type `" + name + "` is new", "");
      }
    }
  }

  Change& add(ChangeKind kind, const std::string& owner, const Location& place, std::string message,
              std::string hint) {
    changes_.push_back({.kind = kind,
                        .owner = owner,
                        .diagnostic = {place, std::move(message), std::move(hint), std::nullopt}});
    return changes_.back();
  }

  Change& add(ChangeKind kind, const Method& before, const Method& after, std::string message,
              std::string hint) {
    Change& change = add(kind, service_, after.location, std::move(message), std::move(hint));
    if (before.location.line != 0) change.diagnostic.note = Note{before.location, "it was this"};
    return change;
  }

  static void break_both(Change& change) {
    change.breaks_old_clients = true;
    change.breaks_new_clients = true;
  }

  void compare_services() {
    const auto old_services = by_name(before_.services);
    const auto new_services = by_name(after_.services);
    for (const auto& [name, service] : old_services) {
      const auto now = new_services.find(name);
      if (now != new_services.end()) {
        compare_service(*service, *now->second);
        continue;
      }
      add(ChangeKind::kServiceRemoved, name, service->location,
          "service `" + name + "` is removed: its clients cannot bind",
          "keep it until the last client is gone")
          .breaks_old_clients = true;
    }
    for (const auto& [name, service] : new_services) {
      if (old_services.contains(name)) continue;
      add(ChangeKind::kServiceAdded, name, service->location, "service `" + name + "` is new", "");
    }
  }

  void compare_service(const Service& before, const Service& after) {
    service_ = after.name;
    if (before.priority_model != after.priority_model || before.priority != after.priority) {
      add(ChangeKind::kPriorityChanged, service_, after.location,
          "service `" + service_ + "` has another priority or priority model", "");
    }
    std::map<std::uint16_t, const Method*> old_methods;
    std::map<std::uint16_t, const Method*> new_methods;
    for (const Method& method : before.methods)
      old_methods.emplace(method.id, &method);
    for (const Method& method : after.methods)
      new_methods.emplace(method.id, &method);
    match_by_name(before, after, old_methods, new_methods);
    for (const auto& [id, method] : old_methods) {
      const auto now = new_methods.find(id);
      if (now == new_methods.end()) {
        remove_method(*method);
      } else {
        compare_method(*method, *now->second);
      }
    }
    for (const auto& [id, method] : new_methods) {
      if (old_methods.contains(id)) continue;
      add(ChangeKind::kMethodAdded, service_, method->location,
          "method `" + method->name + "` of service `" + service_ + "` is new",
          "update the servers before the clients that call it")
          .breaks_new_clients = true;
    }
  }

  /// Treats a method with the same name and another number as one change.
  void match_by_name(const Service& before, const Service& after,
                     std::map<std::uint16_t, const Method*>& old_methods,
                     std::map<std::uint16_t, const Method*>& new_methods) {
    const auto new_names = by_name(after.methods);
    for (const Method& method : before.methods) {
      const auto now = new_names.find(method.name);
      if (now == new_names.end() || now->second->id == method.id) continue;
      break_both(add(ChangeKind::kMethodRenumbered, method, *now->second,
                     "method `" + method.name + "` of service `" + service_ + "` had the number " +
                         std::to_string(method.id) + ", and has " + std::to_string(now->second->id),
                     "keep the number: it is what a call carries"));
      old_methods.erase(method.id);
      new_methods.erase(now->second->id);
    }
  }

  void remove_method(const Method& method) {
    add(ChangeKind::kMethodRemoved, service_, method.location,
        "method `" + method.name + "` of service `" + service_ + "` is removed",
        "keep it until the last client is gone, and never use its number " +
            std::to_string(method.id) + " again")
        .breaks_old_clients = true;
  }

  void compare_method(const Method& before, const Method& after) {
    const std::string words = "method `" + after.name + "` of service `" + service_ + "`";
    if (before.name != after.name) {
      Change& change =
          add(ChangeKind::kMethodRenamed, before, after, words + " was named `" + before.name + "`",
              "the number stays, its meaning may not: add a new method");
      change.reading.is_by_meaning = true;
      break_both(change);
    }
    compare_payload(before, after, before.request, after.request, "request", words);
    compare_payload(before, after, before.reply, after.reply, "reply", words);
    compare_promises(before, after, words);
  }

  void compare_payload(const Method& before, const Method& after, const Payload& then,
                       const Payload& now, const std::string& role, const std::string& words) {
    const std::string& old_table = before_.objects[then.table].name;
    const std::string& new_table = after_.objects[now.table].name;
    if (old_table != new_table) {
      Change& change = add(
          ChangeKind::kPayloadReplaced, before, after,
          "the " + role + " of " + words + " was `" + old_table + "`, and is `" + new_table + '`',
          "add a new method");
      break_both(change);
    } else if (then.kind != now.kind && kind_changes_.insert(new_table).second) {
      const Object& table = after_.objects[now.table];
      Change& change = add(
          ChangeKind::kPayloadKind, service_, table.location,
          "table `" + new_table + "` was sent as " + kind_words(before_, then) +
              ", and is sent as " + kind_words(after_, now) + ": it is the " + role + " of " +
              words,
          "a table with one required struct must stay so, any other must not become so: add a new "
          "table and a new method");
      break_both(change);
    }
  }

  static std::string kind_words(const Model& model, const Payload& payload) {
    if (payload.kind == PayloadKind::kTable) return "a FlatBuffer";
    if (payload.kind == PayloadKind::kEmpty) return "nothing";
    return "the bare struct `" + model.objects[*payload.struct_index].name + '`';
  }

  void compare_promises(const Method& before, const Method& after, const std::string& words) {
    if (before.is_idempotent && !after.is_idempotent) {
      add(ChangeKind::kIdempotentRemoved, before, after,
          words + " is no longer idempotent: older clients repeat it",
          "keep the promise, or add a new method")
          .breaks_old_clients = true;
    } else if (!before.is_idempotent && after.is_idempotent) {
      add(ChangeKind::kIdempotentAdded, before, after,
          words + " became idempotent: newer clients repeat it, also on older servers",
          "update the servers first")
          .breaks_new_clients = true;
    }
    if (before.oneway != after.oneway || before.is_stream != after.is_stream) {
      break_both(add(ChangeKind::kMannerChanged, before, after,
                     words + " was " + manner_of(before) + ", and is " + manner_of(after),
                     "add a new method"));
    }
    if (before.is_deferred != after.is_deferred) {
      add(ChangeKind::kDeferredChanged, before, after,
          words + (after.is_deferred ? " became deferred" : " is no longer deferred"), "");
    }
    if (before.deadline_us != after.deadline_us) {
      add(ChangeKind::kDeadlineChanged, before, after, words + " has another deadline", "");
    }
    compare_size(before, after, words);
  }

  static std::string manner_of(const Method& method) {
    if (method.is_stream) return "a stream";
    return method.oneway ? "oneway, \"" + std::string(spelling_of(*method.oneway)) + '"'
                         : std::string("a call with a reply");
  }

  void compare_size(const Method& before, const Method& after, const std::string& words) {
    if (before.max_size == after.max_size) return;
    const auto size_text = [](const Method& method) {
      return method.max_size ? std::to_string(*method.max_size) + " bytes"
                             : std::string("any size");
    };
    const bool is_raised =
        before.max_size && (!after.max_size || *after.max_size > *before.max_size);
    const std::string message =
        words + " took at most " + size_text(before) + ", and takes " + size_text(after);
    if (is_raised) {
      // Only servers enforce the size: an older one refuses what a newer client may send.
      add(ChangeKind::kMaxSizeRaised, before, after, message,
          "update the servers before the clients that send more")
          .breaks_new_clients = after.request.kind == PayloadKind::kTable;
    } else {
      add(ChangeKind::kMaxSizeLowered, before, after, message,
          "older clients may send more: keep the size, or add a new method")
          .breaks_old_clients = true;
    }
  }

  const Model& before_;
  const Model& after_;
  Uses uses_{};
  std::vector<Change> changes_{};
  std::string service_{};
  std::set<std::string> kind_changes_{};  // Tables already reported.
};

}  // namespace

std::vector<Change> compare(const Model& before, const Model& after) {
  return Comparison(before, after).run();
}

}  // namespace rtpm::schema
