#include "rtpm/etcd_store/etcd_storage.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base64.hpp"
#include "content.hpp"
#include "follow.hpp"
#include "gateway.hpp"
#include "known_names.hpp"
#include "rtpm/base/hash.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "stored_value.hpp"

namespace rtpm::etcd_store {
namespace {

using namespace std::chrono_literals;
using names::StorageError;
using names::StoredChange;
using Kind = StorageError::Kind;

constexpr Duration kLoadPatience = 5s;
// Time limit of changes without a deadline, such as those of --load.
constexpr Duration kCommitPatience = 5s;
// How long to wait for the report of a stored change.
constexpr Duration kReportMax = 300ms;
// The pause before the rules are checked again if no report of the other change is expected.
constexpr Duration kAgainPause = 20ms;

Json compare(const std::string& key, const char* target, const char* field, std::uint64_t value,
             const char* result = "EQUAL") {
  return {{"key", to_base64(key)},
          {"target", target},
          {"result", result},
          {field, std::to_string(value)}};
}

Json range_of(const std::string& key) {
  return {{"request_range", {{"key", to_base64(key)}}}};
}

class EtcdStorage final : public names::Storage {
 public:
  explicit EtcdStorage(Address address) : keys_(address.prefix), gateway_(std::move(address)) {}
  ~EtcdStorage() override { EtcdStorage::stop(); }

  expected<names::StoredContent, SetupError> load() override {
    const MonotonicTime begun = rt::now();
    auto content = read_content(gateway_, keys_, begun + kLoadPatience);
    if (!content) return unexpected{unreachable("can't be read", content.error().why)};
    names::StoredContent loaded{
        .names = std::move(content->names),
        .first_revision = content->revision + 1,
        .identity = fnv1a_64(gateway_.address().prefix, gateway_.cluster()) | 1,
        .place = place()};
    if (content->foreign_count > 0) {
      loaded.faults.push_back(std::to_string(content->foreign_count) + " values in " + place() +
                              " are no names, and left out.");
    }
    known_.replace(std::move(content->known));
    loaded_revision_ = content->revision;
    follow_.set_current(begun);
    return loaded;
  }

  expected<void, SetupError> follow(Follower& follower) override {
    return follow_.start(follower, loaded_revision_);
  }
  void stop() noexcept override { follow_.stop(); }
  [[nodiscard]] bool reports_changes() const noexcept override {
    return follow_.follower() != nullptr;
  }
  [[nodiscard]] MonotonicTime current_as_of() const noexcept override {
    return follow_.current_as_of();
  }

  expected<std::uint64_t, StorageError> commit(const StoredChange& change) override {
    const Unlocked unlocked(follow_.follower());
    return write(change);
  }

  expected<void, StorageError> renew(const StoredChange& change) override {
    const Unlocked unlocked(follow_.follower());
    const auto known = known_.find(change.name);
    const auto conflicts = [&](std::uint64_t revision) {
      return unexpected{after(conflict(revision), change.deadline)};
    };
    if (!known || known->revision != change.expected) return conflicts(known ? known->revision : 0);
    if (known->lease != change.stored->lease) {
      if (const auto written = write(change); !written) return unexpected{written.error()};
      return {};
    }
    if (known->etcd_lease != 0) {
      const auto left = keep_alive(known->etcd_lease, change.deadline);
      if (!left) return unexpected{failure(left.error())};
      if (!*left) return conflicts(0);
    }
    // The etcd lease may outlast its name briefly.
    return check(change.name, change.expected, change.deadline);
  }

  expected<void, StorageError> confirm(std::string_view name, std::uint64_t change,
                                       MonotonicTime deadline) override {
    const Unlocked unlocked(follow_.follower());
    return check(name, change, deadline);
  }

 private:
  /// A lease of etcd, and whether this change created it.
  struct EtcdLease {
    std::uint64_t id = 0;
    bool is_new = false;
  };

  /// An error, and the change that another registry made first.
  struct Conflict : StorageError {
    std::uint64_t revision = 0;
  };

  [[nodiscard]] std::string place() const { return gateway_.address().text(); }
  [[nodiscard]] SetupError unreachable(const std::string& what, const std::string& why) const {
    return {"the names in " + place() + " " + what, why,
            "check that most nodes of etcd run and reach each other"};
  }
  [[nodiscard]] Conflict conflict(std::uint64_t revision) const {
    return {{{"the name in " + place() + " is being changed by another registry all the time",
              {},
              "try again"},
             Kind::kConflict},
            revision};
  }
  /// Returns the error once the registry has the earlier change; kUnreachable if that takes too
  /// long.
  [[nodiscard]] StorageError after(Conflict error, MonotonicTime deadline) {
    if (error.kind != Kind::kConflict || follow_.follower() == nullptr) return error;
    // The end of a lease is not reported yet, or the report adds nothing to what the registry
    // knows.
    const bool is_pause = error.revision == 0 || follow_.has_reported(error.revision);
    const MonotonicTime end = rt::now() + kAgainPause;
    const bool is_in_time = is_pause ? end < deadline : follow_.wait_for(error.revision, deadline);
    if (!is_in_time) error.kind = Kind::kUnreachable;
    if (is_in_time && is_pause) rt::sleep_until(end);
    return error;
  }
  [[nodiscard]] Conflict failure(const GatewayError& error) const {
    if (error.code == GatewayError::kUnavailable) {
      return {{unreachable("did not take the change", error.why), Kind::kUnreachable}};
    }
    const bool is_full = error.code == GatewayError::kExhausted;
    const char* const remedy =
        is_full ? "compact and defragment it, then disarm its alarm" : "see the log of etcd";
    return {{{"the names in " + place() + " did not take the change", error.why, remedy},
             is_full ? Kind::kFull : Kind::kFailed}};
  }

  /// Stores the change, and waits for its report.
  expected<std::uint64_t, StorageError> write(const StoredChange& change) {
    const MonotonicTime deadline = std::min(change.deadline, rt::now() + kCommitPatience);
    const auto done = change.stored == nullptr ? erase(change, deadline) : put(change, deadline);
    if (!done) return unexpected{after(done.error(), deadline)};
    if (follow_.follower() != nullptr) {
      static_cast<void>(follow_.wait_for(*done, std::min(deadline, rt::now() + kReportMax)));
    }
    return *done;
  }

  /// Checks that `change` is still the last change of the name.
  expected<void, StorageError> check(std::string_view name, std::uint64_t change,
                                     MonotonicTime deadline) {
    const std::string key = keys_.key_of(name);
    const auto known = known_.find(name);
    const bool is_foreign = change == 0 && known && known->is_foreign;
    const Json request{
        {"compare",
         Json::array({compare(key, "MOD", "mod_revision", is_foreign ? known->revision : change)})},
        {"failure", Json::array({range_of(key)})}};
    const auto answer = gateway_.ask("/v3/kv/txn", request, deadline);
    if (!answer) return unexpected{failure(answer.error())};
    const auto revision = revision_of(*answer, [](const KeyValue&) { return false; });
    if (!revision) return unexpected{after(revision.error(), deadline)};
    return {};
  }

  /// Returns whether the lease still existed.
  [[nodiscard]] expected<bool, GatewayError> keep_alive(std::uint64_t lease,
                                                        MonotonicTime deadline) {
    const Json request{{"ID", std::to_string(lease)}};
    const auto answer = gateway_.ask("/v3/lease/keepalive", request, deadline);
    if (!answer) return unexpected{answer.error()};
    return number_at(*answer, "TTL") != 0;
  }

  /// The lease to use for a name: the holder's current lease, or a new one.
  [[nodiscard]] expected<EtcdLease, GatewayError> lease_for(const StoredChange& change,
                                                            const std::optional<KnownName>& known,
                                                            MonotonicTime deadline) {
    const names::StoredName& stored = *change.stored;
    if (stored.is_permanent()) return EtcdLease{};
    const bool is_kept = known && known->revision == change.expected && known->etcd_lease != 0 &&
                         stored.revision != change.revision &&
                         seconds_of(known->lease) == seconds_of(stored.lease);
    if (is_kept) {
      const auto left = keep_alive(known->etcd_lease, deadline);
      if (!left) return unexpected{left.error()};
      if (*left) return EtcdLease{known->etcd_lease, false};
    }
    const Json request{{"TTL", std::to_string(seconds_of(stored.lease))}};
    const auto granted = gateway_.ask("/v3/lease/grant", request, deadline);
    if (!granted) return unexpected{granted.error()};
    return EtcdLease{number_at(*granted, "ID"), true};
  }

  expected<std::uint64_t, Conflict> put(const StoredChange& change, MonotonicTime deadline) {
    const std::string name(change.name);
    const auto known = known_.find(name);
    const auto lease = lease_for(change, known, deadline);
    if (!lease) return unexpected{failure(lease.error())};
    StoredValue value{*change.stored, rt::random_u64()};
    if (value.stored.revision == change.revision) value.stored.revision = 0;
    Json success{{"key", to_base64(keys_.key_of(name))}, {"value", to_base64(to_text(value))}};
    if (lease->id != 0) success["lease"] = std::to_string(lease->id);
    const Json request{{"compare", conditions_of(change, known)},
                       {"success", Json::array({{{"request_put", std::move(success)}}})},
                       {"failure", looks_of(change)}};
    const auto answer = gateway_.ask("/v3/kv/txn", request, deadline);
    const auto is_own = [&](const KeyValue& found) {
      const auto written = parse_value(found.value);
      return found.key == keys_.key_of(name) && written && written->write == value.write;
    };
    auto revision = answer ? revision_of(*answer, is_own)
                           : expected<std::uint64_t, Conflict>(unexpected{failure(answer.error())});
    const bool is_lease_over = !answer && answer.error().code == GatewayError::kNotFound;
    if (is_lease_over) revision = unexpected{conflict(0)};
    // If the result is unknown, the new lease may be in use.
    const bool is_unused = !revision && revision.error().kind != Kind::kUnreachable;
    if (lease->is_new && is_unused) known_.add_unused(lease->id);
    if (revision && known && known->etcd_lease != lease->id) known_.add_unused(known->etcd_lease);
    return revision;
  }

  // The conditions of a change: the name's last change is still the expected one. If the name was
  // not bound, also: nothing is bound above or below it, and it was not unbound since, so that a
  // stopped node's late request does not restore the name.
  [[nodiscard]] Json conditions_of(const StoredChange& change,
                                   const std::optional<KnownName>& known) const {
    const std::string name(change.name);
    const bool replaces_foreign = change.expected == 0 && known && known->is_foreign;
    Json conditions = Json::array();
    conditions.push_back(compare(keys_.key_of(name), "MOD", "mod_revision",
                                 replaces_foreign ? known->revision : change.expected));
    if (change.expected != 0) return conditions;
    for (const std::string& above : above_of(name))
      conditions.push_back(compare(keys_.key_of(above), "CREATE", "create_revision", 0));
    Json below = compare(keys_.key_of(name + '/'), "CREATE", "create_revision", 0);
    below["range_end"] = to_base64(keys_.key_of(name + '0'));
    conditions.push_back(std::move(below));
    conditions.push_back(
        compare(keys_.fence_of(name), "MOD", "mod_revision", change.revision, "LESS"));
    return conditions;
  }

  // The ranges to read if a condition does not hold.
  [[nodiscard]] Json looks_of(const StoredChange& change) const {
    const std::string name(change.name);
    Json looks = Json::array({range_of(keys_.key_of(name))});
    if (change.expected != 0) return looks;
    for (const std::string& above : above_of(name))
      looks.push_back(range_of(keys_.key_of(above)));
    looks.push_back({{"request_range",
                      {{"key", to_base64(keys_.key_of(name + '/'))},
                       {"range_end", to_base64(keys_.key_of(name + '0'))},
                       {"limit", 1},
                       {"keys_only", true}}}});
    looks.push_back(range_of(keys_.fence_of(name)));
    return looks;
  }

  [[nodiscard]] static std::vector<std::string> above_of(const std::string& name) {
    std::vector<std::string> above;
    for (std::size_t end = name.find('/'); end != std::string::npos; end = name.find('/', end + 1))
      above.push_back(name.substr(0, end));
    return above;
  }

  expected<std::uint64_t, Conflict> erase(const StoredChange& change, MonotonicTime deadline) {
    const std::string name(change.name);
    const auto known = known_.find(name);
    const std::string fence = keys_.fence_of(name);
    const std::string write = std::to_string(rt::random_u64());
    const Json request{
        {"compare",
         Json::array({compare(keys_.key_of(name), "MOD", "mod_revision", change.expected)})},
        {"success",
         Json::array(
             {{{"request_delete_range", {{"key", to_base64(keys_.key_of(name))}}}},
              {{"request_put", {{"key", to_base64(fence)}, {"value", to_base64(write)}}}}})},
        {"failure", Json::array({range_of(keys_.key_of(name)), range_of(fence)})}};
    const auto answer = gateway_.ask("/v3/kv/txn", request, deadline);
    if (!answer) return unexpected{failure(answer.error())};
    const auto revision = revision_of(
        *answer, [&](const KeyValue& found) { return found.key == fence && found.value == write; });
    if (revision && known) known_.add_unused(known->etcd_lease);
    return revision;
  }

  // The revision of the change if it was made, even by an earlier request for the same change;
  // otherwise the change that was found instead.
  // @param is_own  whether an earlier request for the same change wrote this value
  template <class IsOwn>
  [[nodiscard]] expected<std::uint64_t, Conflict> revision_of(const Json& answer,
                                                              IsOwn is_own) const {
    if (answer.value("succeeded", Json()) == true) {
      return number_at(object_at(answer, "header"), "revision");
    }
    std::uint64_t last = 0;
    for (const Json& response : object_at(answer, "responses")) {
      for (const Json& each : object_at(object_at(response, "response_range"), "kvs")) {
        const auto found = key_value_of(each);
        if (!found) continue;
        if (is_own(*found)) return found->mod_revision;
        last = std::max(last, found->mod_revision);
      }
    }
    return unexpected{conflict(last)};
  }

  Keys keys_;
  Gateway gateway_;
  KnownNames known_{};
  Follow follow_{gateway_, keys_, known_};
  std::uint64_t loaded_revision_ = 0;
};

}  // namespace

expected<std::unique_ptr<names::Storage>, SetupError> make_etcd_storage(std::string_view url) {
  auto address = parse_address(url);
  if (!address) return unexpected{std::move(address.error())};
  return std::unique_ptr<names::Storage>(std::make_unique<EtcdStorage>(std::move(*address)));
}

}  // namespace rtpm::etcd_store
