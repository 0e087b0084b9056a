#include "rtpm/names/directory.hpp"

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "client/no_answer.hpp"
#include "client/service.hpp"
#include "finding/service_trust.hpp"
#include "model/interface_index.hpp"
#include "model/query.hpp"
#include "model/record.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/discovery/finder.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/names/reachable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/parallel_jobs.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::names {
namespace {

/// How long services found on the LAN are reused instead of a new query.
constexpr Duration kLanFindsAge = std::chrono::seconds{1};
/// How many services are asked concurrently.
constexpr std::size_t kThreadCountMax = 8;

/// Whether a server only serves its own host.
bool is_loopback(const std::string& url) {
  const auto parts = wire::parse_url(url);
  return parts && std::ranges::all_of(parts->hosts, [](const std::string& host) {
           const auto address = transport::SocketAddress::parse(host, 0);
           return address ? address->is_loopback() : host == "localhost";
         });
}

/// "rtpm://… (process 4711 of this host)".
std::string in_words(const NameEntry& entry, const discovery::FoundService& found) {
  std::string text = printable(entry.url) + " (";
  if (found.is_registry) return text + "by the registry " + found.url + ")";
  if (found.process_id != 0) text += "process " + std::to_string(found.process_id) + " of ";
  const auto parts = wire::parse_url(found.url);
  return text + (found.is_of_this_host || !parts ? "this host" : "host " + parts->hosts.front()) +
         ")";
}

/// How much a refusal reveals about the name: naming a later component reveals more.
int knowledge_of(const DirectoryError& error) {
  if (error.outcome == Outcome::kNotADirectory) return 3;
  if (error.outcome == Outcome::kIsADirectory) return 2;
  return error.outcome ? 1 : 0;
}

}  // namespace

class Directory::Impl {
 public:
  /// A service found, and its client.
  struct Asked {
    discovery::FoundService found;
    std::shared_ptr<Service> service;
  };
  /// The answer of a service.
  template <class Value>
  struct Answer {
    Value value;
    discovery::FoundService found;
  };
  template <class Value>
  struct Answers {
    std::vector<Answer<Value>> values{};
    /// The most informative refusal, if any.
    std::optional<DirectoryError> refusal{};
  };

  Impl(rpc::Node& node, std::string where, Duration deadline)
      : where_text(std::move(where)), node_(node), deadline_(deadline) {
    auto scope = discovery::parse_scope(where_text);
    if (scope) {
      scope_ = std::move(*scope);
    } else {
      bad_scope_ = std::move(scope.error());
    }
    if (!bad_scope_ && scope_.is_url()) only_ = service_at(where_text, deadline_);
  }

  /// The service, if the scope is a URL; null if services are searched for.
  [[nodiscard]] Service* only() const noexcept { return only_.get(); }

  /// Asks all services, several concurrently, so that a hanging one delays no others.
  /// @errors   no service answers
  template <class Value, class Operation>
  [[nodiscard]] expected<Answers<Value>, DirectoryError> ask_all(MonotonicTime deadline,
                                                                 Operation operation) {
    clear_notes();
    const MonotonicTime end = std::min(deadline, rt::now() + deadline_);
    const auto asked = find(end);
    if (!asked) return unexpected{asked.error()};
    std::vector<std::optional<expected<Value, DirectoryError>>> replies(asked->size());
    const auto ask = [&](std::size_t i) {
      if (rt::now() < end) replies[i] = operation(*(*asked)[i].service);
    };
    if (asked->size() == 1) {
      ask(0);  // The usual case needs no thread.
    } else {
      rt::ParallelJobs jobs("rtpm-ask", kThreadCountMax);
      for (std::size_t i = 0; i < asked->size(); ++i)
        jobs.add([&, i] { ask(i); });
    }
    Answers<Value> answers;
    std::size_t silent_count = 0;
    std::string remedy = "rtpm doctor says what discovery finds";
    for (std::size_t i = 0; i < replies.size(); ++i) {
      const discovery::FoundService& found = (*asked)[i].found;
      auto& reply = replies[i];
      if (reply && *reply) {
        answers.values.push_back({std::move(**reply), found});
      } else if (reply && reply->error().outcome) {
        const bool says_more =
            !answers.refusal || knowledge_of(reply->error()) > knowledge_of(*answers.refusal);
        if (says_more) answers.refusal = std::move(reply->error());
      } else if (!found.is_guess) {
        ++silent_count;
        const bool is_closed = reply && is_about_keys(reply->error());
        if (is_closed) remedy = reply->error().remedy;
        note(is_closed ? reply->error().reason()
                       : "no name service answers at " + found.url +
                             (reply ? "" : ": there was no time left"));
      }
    }
    if (!answers.values.empty() || answers.refusal) return answers;
    return unexpected{nobody(silent_count, remedy)};
  }

  /// The registry that makes changes.
  [[nodiscard]] expected<std::shared_ptr<Service>, DirectoryError> registry() {
    if (only_) return only_;
    clear_notes();
    const auto asked = find(rt::now() + deadline_);
    if (!asked) return unexpected{asked.error()};
    std::vector<Asked> registries;
    for (const Asked& each : *asked) {
      if (!each.found.is_registry) continue;
      if (each.found.is_of_this_host && !each.found.is_guess) return each.service;
      registries.push_back(each);
    }
    // The registry at the default address.
    std::erase_if(registries, [](const Asked& each) {
      return each.found.is_guess && !each.service->contents({});
    });
    for (const Asked& each : registries) {
      if (auto trusted = check_service(node_, each.found.url); !trusted) {
        return unexpected{DirectoryError{std::move(trusted.error())}};
      }
    }
    if (registries.size() == 1) return registries.front().service;
    if (registries.empty()) {
      return unexpected{
          DirectoryError{{"no registry runs here, and only a registry takes names "
                          "for others",
                          "", "start rtpm-registryd, or give --registry URL"}}};
    }
    std::string urls;
    for (const Asked& each : registries)
      urls += (urls.empty() ? "" : ", ") + each.found.url;
    return unexpected{
        DirectoryError{{"several registries are found: " + urls, "", "give one by --registry"}}};
  }

  /// Drops names that this host cannot reach.
  void add(std::vector<Answer<NameEntry>>& to, NameEntry entry,
           const discovery::FoundService& found) {
    if (!found.is_of_this_host && is_loopback(entry.url)) {
      note("'" + printable(entry.name) + "' at " + found.url + " leads to that host's own " +
           printable(entry.url) + "; have its server serve the network with --host");
      return;
    }
    entry.service_url = found.url;
    to.push_back({std::move(entry), found});
  }

  /// Drops names of another user's registry that another service also has, so that the registry
  /// can't take a name from its server. If only such registries have the name, keeps them.
  void drop_untrusted(std::vector<Answer<NameEntry>>& entries) {
    std::vector<Answer<NameEntry>> trusted;
    for (const auto& entry : entries) {
      const auto checked = check_service(node_, entry.found.url);
      if (checked) trusted.push_back(entry);
      if (!checked) {
        note("'" + printable(entry.value.name) + "' at " + entry.found.url +
             " is left out: " + checked.error().text());
      }
    }
    if (!trusted.empty()) entries = std::move(trusted);
  }

  void note(std::string sentence) {
    constexpr std::size_t kNoteCountMax = 32;
    const std::lock_guard lock(mutex_);
    if (notes_.size() < kNoteCountMax) notes_.push_back(std::move(sentence));
  }

  [[nodiscard]] std::vector<std::string> notes() {
    const std::lock_guard lock(mutex_);
    return notes_;
  }

  const std::string where_text;

 private:
  void clear_notes() {
    const std::lock_guard lock(mutex_);
    notes_.clear();
  }

  [[nodiscard]] std::shared_ptr<Service> service_at(const std::string& url, Duration deadline) {
    return std::make_shared<Service>(node_, url, deadline);
  }

  /// Keeps the clients, with their sessions, of services found again.
  [[nodiscard]] expected<std::vector<Asked>, DirectoryError> find(MonotonicTime deadline) {
    if (bad_scope_) return unexpected{DirectoryError{*bad_scope_}};
    const std::lock_guard finding(finding_);
    const bool is_fresh = scope_.is_of_lan() && rt::now() - found_at_ < kLanFindsAge;
    if (!is_fresh) {
      auto found = discovery::find_services(scope_, deadline);
      if (!found) return unexpected{DirectoryError{std::move(found.error())}};
      found_ = std::move(*found);
      found_at_ = rt::now();
    }
    std::vector<Asked> asked;
    std::map<std::string, std::shared_ptr<Service>> kept;
    for (const discovery::FoundService& each : found_.services) {
      auto& service = services_[each.url];
      if (!service) service = service_at(each.url, each.is_registry ? deadline_ : deadline_ / 4);
      kept[each.url] = service;
      asked.push_back({each, service});
    }
    services_ = std::move(kept);
    for (const std::string& sentence : found_.notes)
      note(sentence);
    return asked;
  }

  [[nodiscard]] DirectoryError nobody(std::size_t silent_count, const std::string& remedy) {
    const std::string place = scope_.is_of_lan() ? "this host or the LAN" : "this host";
    if (silent_count == 0) {
      return {
          {"there are no names: no registry runs, and no server that serves its names itself, "
           "on " +
               place,
           "", "start rtpm-registryd or a server, or give --registry URL"}};
    }
    const auto said = notes();
    return {{"none of the name services on " + place + " answers", said.empty() ? "" : said.front(),
             remedy}};
  }

  rpc::Node& node_;
  const Duration deadline_;
  discovery::Scope scope_{};
  std::optional<SetupError> bad_scope_{};
  std::shared_ptr<Service> only_{};
  std::mutex finding_;  ///< Guards the members below; not for real-time threads.
  discovery::FoundServices found_{};
  MonotonicTime found_at_{};
  std::map<std::string, std::shared_ptr<Service>> services_{};
  std::mutex mutex_;  ///< Guards the notes.
  std::vector<std::string> notes_{};
};

namespace {

using Found = discovery::FoundService;

/// Sorts by name, marks names with different URLs, and drops duplicates.
template <class Answers>
std::vector<NameEntry> merged(Answers answers) {
  std::ranges::stable_sort(
      answers, {}, [](const auto& answer) -> const std::string& { return answer.value.name; });
  std::vector<NameEntry> entries;
  for (auto& answer : answers) {
    bool is_known = false;
    for (auto other = entries.rbegin(); other != entries.rend() && other->name == answer.value.name;
         ++other) {
      is_known |= other->url == answer.value.url;
      if (other->url == answer.value.url) continue;
      other->is_duplicate = true;
      answer.value.is_duplicate = true;
    }
    if (!is_known) entries.push_back(std::move(answer.value));
  }
  return entries;
}

// "; most like it: lab/arm0, lab/arm1", or empty.
std::string similar_names(Directory& directory, const std::string& name) {
  const auto bound = directory.list();
  if (!bound) return {};
  std::vector<std::string> names;
  for (const NameEntry& entry : *bound) {
    if (wire::is_valid_path(entry.name)) names.push_back(entry.name);
  }
  const auto middle = names.begin() + static_cast<std::ptrdiff_t>(
                                          std::min(names.size(), wire::kSimilarPathCountMax));
  std::ranges::partial_sort(
      names, middle, std::ranges::greater{},
      [&](const std::string& candidate) { return wire::similarity(candidate, name); });
  std::string text;
  for (auto candidate = names.begin(); candidate != middle; ++candidate)
    text += (text.empty() ? "; most like it: " : ", ") + *candidate;
  return text;
}

Record record_of(const NameEntry& entry) {
  Record record{.name = entry.name, .url = entry.url, .interface = entry.interface};
  record.properties = entry.properties;
  return record;
}

}  // namespace

Directory::Directory(rpc::Node& node, std::string where, Duration deadline)
    : impl_(std::make_unique<Impl>(node, std::move(where), deadline)) {}
Directory::Directory(Directory&&) noexcept = default;
Directory& Directory::operator=(Directory&&) noexcept = default;
Directory::~Directory() = default;

const std::string& Directory::where() const noexcept {
  return impl_->where_text;
}
std::vector<std::string> Directory::notes() const {
  return impl_->notes();
}

expected<Granted, DirectoryError> Directory::bind(const Claim& claim) {
  const auto registry = impl_->registry();
  if (!registry) return unexpected{registry.error()};
  return (*registry)->bind(claim, /*replaces=*/false);
}

expected<Granted, DirectoryError> Directory::rebind(const Claim& claim) {
  const auto registry = impl_->registry();
  if (!registry) return unexpected{registry.error()};
  return (*registry)->bind(claim, /*replaces=*/true);
}

expected<void, DirectoryError> Directory::renew(std::string_view name, Owner owner,
                                                Duration lease) {
  const auto registry = impl_->registry();
  if (!registry) return unexpected{registry.error()};
  return (*registry)->renew(name, owner, lease);
}

expected<void, DirectoryError> Directory::unbind(std::string_view name, Owner owner,
                                                 std::uint64_t holder_revision) {
  const auto registry = impl_->registry();
  if (!registry) return unexpected{registry.error()};
  return (*registry)->unbind(name, owner, holder_revision);
}

expected<NameEntry, DirectoryError> Directory::look_up(std::string_view name, bool has_properties,
                                                       MonotonicTime deadline) {
  if (Service* const only = impl_->only()) return only->look_up(name, has_properties, deadline);
  auto answers = impl_->ask_all<NameEntry>(
      deadline, [&](Service& service) { return service.look_up(name, has_properties, deadline); });
  if (!answers) return unexpected{answers.error()};
  std::vector<Impl::Answer<NameEntry>> entries;
  for (auto& answer : answers->values)
    impl_->add(entries, std::move(answer.value), answer.found);
  if (entries.size() > 1) impl_->drop_untrusted(entries);
  if (entries.empty()) {
    if (answers->refusal) return unexpected{std::move(*answers->refusal)};
    return unexpected{DirectoryError{
        {"'" + printable(name) + "' is not reached from here", impl_->notes().front()}}};
  }
  for (const auto& other : entries) {
    if (other.value.url == entries.front().value.url) continue;
    DirectoryError error{{"the name '" + printable(name) + "' is bound twice: to " +
                              in_words(entries.front().value, entries.front().found) + " and to " +
                              in_words(other.value, other.found),
                          "", "end or rename one of the servers, or give --registry URL"}};
    error.is_ambiguous = true;
    return unexpected{std::move(error)};
  }
  return std::move(entries.front().value);
}

expected<NameEntry, DirectoryError> Directory::resolve(std::string_view name,
                                                       MonotonicTime deadline) {
  return look_up(name, /*has_properties=*/false, deadline);
}

expected<NameEntry, DirectoryError> Directory::describe(std::string_view name,
                                                        MonotonicTime deadline) {
  return look_up(name, /*has_properties=*/true, deadline);
}

expected<FoundNames, DirectoryError> Directory::find(const NameQuery& query) {
  if (Service* const only = impl_->only()) return only->find(query);
  // The preference orders the names of all services together, so predicate and preference are
  // evaluated here.
  auto answers = impl_->ask_all<FoundNames>(
      kNever, [&](Service& service) { return service.find({.interface = query.interface}); });
  if (!answers) return unexpected{answers.error()};
  std::vector<Impl::Answer<NameEntry>> all;
  for (auto& answer : answers->values) {
    if (answer.value.entries.size() < answer.value.accepted_count) {
      impl_->note("the name service at " + answer.found.url + " has more names than a reply takes");
    }
    for (NameEntry& entry : answer.value.entries)
      impl_->add(all, std::move(entry), answer.found);
  }
  const std::vector<NameEntry> entries = merged(std::move(all));
  std::vector<Record> records;
  records.reserve(entries.size());
  InterfaceIndex index;
  for (const NameEntry& entry : entries) {
    if (!records.empty() && records.back().name == entry.name) continue;
    records.push_back(record_of(entry));
    index.add(records.back());
  }
  const std::size_t count_max = query.limit == 0 ? entries.size() : query.limit;
  const auto chosen = names::find(index, {query.interface, query.predicate, query.preference},
                                  count_max, rt::random_u64());
  if (!chosen) {
    const QueryError& error = chosen.error();
    DirectoryError refused{{outcome_text(error.outcome, query.interface, 0), error.error.what},
                           error.outcome};
    refused.text_error = error.error;
    return unexpected{std::move(refused)};
  }
  FoundNames found{.accepted_count = static_cast<std::uint32_t>(chosen->accepted_count),
                   .note = chosen->note};
  for (const NameEntry& entry : entries)
    found.stale_for = std::max(found.stale_for, entry.stale_for);
  for (const Record* record : chosen->records) {
    std::ranges::copy_if(entries, std::back_inserter(found.entries),
                         [&](const NameEntry& entry) { return entry.name == record->name; });
  }
  return found;
}

expected<NameEntry, DirectoryError> Directory::entry_of(std::string_view name,
                                                        MonotonicTime deadline) {
  std::string_view bound = name;
  auto entry = resolve(bound, deadline);
  while (!entry && entry.error().outcome == Outcome::kNotADirectory) {
    const std::size_t slash = bound.rfind('/');
    if (slash == std::string_view::npos) break;
    bound = bound.substr(0, slash);
    entry = resolve(bound, deadline);
  }
  return entry;
}

expected<std::string, DirectoryError> Directory::url_of(std::string_view name,
                                                        MonotonicTime deadline) {
  const auto entry = entry_of(name, deadline);
  if (!entry) return unexpected{entry.error()};
  auto url = reachable_url(*entry);
  if (!url) return unexpected{DirectoryError{std::move(url.error())}};
  return *url + std::string(name.substr(entry->name.size()));
}

expected<std::vector<NameEntry>, DirectoryError> Directory::list(std::string_view directory) {
  auto all = contents(directory);
  if (!all) return unexpected{std::move(all.error())};
  return std::move(all->entries);
}

expected<FoundNames, DirectoryError> Directory::contents(std::string_view directory) {
  if (Service* const only = impl_->only()) return only->contents(directory);
  auto answers = impl_->ask_all<FoundNames>(
      kNever, [&](Service& service) { return service.contents(directory); });
  if (!answers) return unexpected{answers.error()};
  if (answers->values.empty()) return unexpected{std::move(*answers->refusal)};
  FoundNames found;
  std::vector<Impl::Answer<NameEntry>> all;
  for (auto& answer : answers->values) {
    found.stale_for = std::max(found.stale_for, answer.value.stale_for);
    for (NameEntry& entry : answer.value.entries)
      impl_->add(all, std::move(entry), answer.found);
  }
  found.entries = merged(std::move(all));
  found.accepted_count = static_cast<std::uint32_t>(found.entries.size());
  return found;
}

expected<std::string, SetupError> url_of(rpc::Node& node, const std::string& where,
                                         const std::string& target) {
  if (wire::is_url(target)) return target;
  Directory directory(node, where);
  auto url = directory.url_of(target);
  if (url) return std::move(*url);
  DirectoryError& error = url.error();
  if (error.outcome == Outcome::kNotFound) error.what += similar_names(directory, target);
  return unexpected{std::move(error)};
}

std::string stale_text(Duration stale_for) {
  const auto tenths = stale_for / std::chrono::milliseconds{100};
  return "the registry has had no word from its storage for " + std::to_string(tenths / 10) + '.' +
         std::to_string(tenths % 10) + " s: what it has may be out of date";
}

}  // namespace rtpm::names
