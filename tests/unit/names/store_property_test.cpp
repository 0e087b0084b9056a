#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <random>
#include <set>

#include "store/store.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

/// The result of an operation: an outcome, a component, a list of names.
struct Answer {
  Outcome outcome = Outcome::kDone;
  int component = 0;
  std::vector<std::string> names{};
  friend bool operator==(const Answer&, const Answer&) = default;
  friend std::ostream& operator<<(std::ostream& out, const Answer& answer) {
    out << "outcome " << static_cast<int>(answer.outcome) << " at " << answer.component << ":";
    for (const std::string& name : answer.names)
      out << ' ' << name;
    return out;
  }
};

/// The store's semantics, implemented by plain loops over a plain list.
class Model {
 public:
  static constexpr std::size_t kCountMax = 6;
  static constexpr std::size_t kCountPerOwnerMax = 4;
  static constexpr std::size_t kCountPerHostMax = 4;
  static constexpr std::size_t kOwnerCountPerHostMax = 2;
  static constexpr Duration kFirstLeaseMax = 700ms;

  void advance(MonotonicTime now) {
    for (const Record& record : records_) {
      if (record.expires <= now) lapsed_[record.name] = record.owner.id;
    }
    std::erase_if(records_, [&](const Record& record) { return record.expires <= now; });
  }

  Answer bind(Record claimed, Duration lease, bool replaces, MonotonicTime now) {
    Record* const held = find(claimed.name);
    const bool is_kept = held != nullptr && held->owner == claimed.owner;
    claimed.bound = is_kept ? held->bound : now;
    claimed.expires = now + lease_for(claimed, lease, now);
    if (held == nullptr) {
      if (Answer conflict = conflict_of(claimed.name); conflict.outcome != Outcome::kDone)
        return conflict;
      if (records_.size() >= kCountMax) return {Outcome::kFull};
    } else if (held->owner.id == claimed.owner.id && claimed.owner.epoch < held->owner.epoch) {
      return about(Outcome::kStaleEpoch, claimed.name);
    } else if (!is_kept && !replaces &&
               (held->owner.id != claimed.owner.id || held->host != claimed.host)) {
      return about(Outcome::kAlreadyBound, claimed.name);
    }
    const auto count_if = [&](auto predicate) {
      return static_cast<std::size_t>(std::count_if(records_.begin(), records_.end(), predicate));
    };
    const auto is_its = [&](const Record& record) { return record.owner.id == claimed.owner.id; };
    const auto is_here = [&](const Record& record) { return record.host == claimed.host; };
    if ((held == nullptr || !is_its(*held)) && count_if(is_its) >= kCountPerOwnerMax) {
      return {Outcome::kOwnerFull};
    }
    if ((held == nullptr || !is_here(*held)) && count_if(is_here) >= kCountPerHostMax) {
      return {Outcome::kHostFull};
    }
    std::set<std::uint64_t> owners;
    for (const Record& record : records_) {
      if (is_here(record)) owners.insert(record.owner.id);
    }
    if (!owners.contains(claimed.owner.id) && owners.size() >= kOwnerCountPerHostMax) {
      return {Outcome::kHostOwnersFull};
    }
    if (held != nullptr) {
      *held = claimed;
    } else {
      records_.push_back(claimed);
    }
    lapsed_.erase(claimed.name);
    return {};
  }

  Answer renew(const std::string& name, Owner owner, Duration lease, MonotonicTime now) {
    Record* const held = find(name);
    if (held == nullptr) return missing(name);
    if (held->owner == owner) {
      held->expires = now + lease_for(*held, lease, now);
      return {};
    }
    const bool is_earlier = held->owner.id == owner.id && owner.epoch < held->owner.epoch;
    return about(is_earlier ? Outcome::kStaleEpoch : Outcome::kNotOwner, name);
  }

  Answer unbind(const std::string& name, Owner owner) {
    Record* const held = find(name);
    if (held == nullptr) {
      const auto lapsed = lapsed_.find(name);
      if (lapsed == lapsed_.end() || lapsed->second != owner.id) return missing(name);
      lapsed_.erase(lapsed);
      return {};
    }
    if (held->owner.id != owner.id) return about(Outcome::kNotOwner, name);
    if (owner.epoch < held->owner.epoch) return about(Outcome::kStaleEpoch, name);
    std::erase_if(records_, [&](const Record& record) { return record.name == name; });
    return {};
  }

  Answer resolve(const std::string& name) {
    const Record* const held = find(name);
    if (held == nullptr) return missing(name);
    return {.names = {held->name, held->url, std::to_string(to_ns(held->expires))}};
  }

  Answer list(const std::string& directory) {
    Answer answer;
    for (const Record& record : records_) {
      if (directory.empty() || record.name == directory || is_below(record.name, directory)) {
        answer.names.push_back(record.name);
      }
    }
    std::sort(answer.names.begin(), answer.names.end());
    return answer;
  }

 private:
  static Duration lease_for(const Record& record, Duration lease, MonotonicTime now) {
    return now - record.bound < kFirstLeaseMax ? std::min(lease, kFirstLeaseMax) : lease;
  }
  static bool is_below(const std::string& name, const std::string& directory) {
    return name.starts_with(directory + "/");
  }
  static int depth(const std::string& name) {
    return static_cast<int>(std::count(name.begin(), name.end(), '/'));
  }
  static Answer about(Outcome outcome, const std::string& name) { return {outcome, depth(name)}; }

  Record* find(const std::string& name) {
    const auto found = std::find_if(records_.begin(), records_.end(),
                                    [&](const Record& record) { return record.name == name; });
    return found == records_.end() ? nullptr : &*found;
  }

  Answer conflict_of(const std::string& name) const {
    for (const Record& record : records_) {
      if (is_below(name, record.name)) return about(Outcome::kNotADirectory, record.name);
    }
    for (const Record& record : records_) {
      if (is_below(record.name, name)) return about(Outcome::kIsADirectory, name);
    }
    return {};
  }

  Answer missing(const std::string& name) const {
    if (Answer conflict = conflict_of(name); conflict.outcome != Outcome::kDone) return conflict;
    // The first component that no bound name shares.
    for (std::size_t end = 0, component = 0; end != std::string::npos; ++component) {
      end = name.find('/', end + 1);
      const std::string upto = name.substr(0, end);
      const bool is_shared =
          std::any_of(records_.begin(), records_.end(),
                      [&](const Record& record) { return is_below(record.name, upto); });
      if (!is_shared) return {Outcome::kNotFound, static_cast<int>(component)};
    }
    ADD_FAILURE() << name << " is neither there nor missing";
    return {};
  }

  std::vector<Record> records_;
  std::map<std::string, std::uint64_t> lapsed_;  ///< The owners of names whose lease ended.
};

template <class T>
Answer answer_of(const expected<T, Refusal>& result) {
  if (!result) return {result.error().outcome, result.error().component};
  return {};
}

class StoreProperty : public testing::TestWithParam<unsigned> {
 protected:
  template <std::size_t Count>
  const char* pick(const std::array<const char*, Count>& choices) {
    return choices[below(Count)];
  }
  std::size_t below(std::size_t bound) {
    return std::uniform_int_distribution<std::size_t>(0, bound - 1)(random_);
  }
  Owner random_owner() { return {.id = 1 + below(3), .epoch = 1 + below(3)}; }
  std::string random_name() {
    // Few names of few components, so that they collide; '-' sorts before '/', '0' after it.
    return pick(std::array{"a", "a/a", "a/b", "a/b/c", "a-b", "a0", "b", "b/a", "b/a/a"});
  }

  std::mt19937 random_{GetParam()};
};

TEST_P(StoreProperty, BehavesAsTheModel) {
  Store store({.name_count_max = Model::kCountMax,
               .name_count_per_owner_max = Model::kCountPerOwnerMax,
               .name_count_per_host_max = Model::kCountPerHostMax,
               .owner_count_per_host_max = Model::kOwnerCountPerHostMax,
               .first_lease_max = Model::kFirstLeaseMax});
  Model model;
  MonotonicTime now{};
  for (int step = 0; step < 2000; ++step) {
    now += below(4) == 0 ? Duration{below(400'000'000)} : Duration{0};
    model.advance(now);
    const std::string name = random_name();
    const Owner owner = random_owner();
    const Duration lease = 100ms + Duration{below(2'000'000'000)};
    const std::string url = "rtpm://h:1/" + std::to_string(step);
    SCOPED_TRACE(testing::Message() << "step " << step << ", name " << name << ", owner "
                                    << owner.id << '.' << owner.epoch);
    switch (below(7)) {
      case 0:
      case 1:
      case 2: {
        const bool replaces = below(4) == 0;
        const auto host = static_cast<std::uint32_t>(1 + below(2));
        Claim claim{name, url, "lab.Arm", owner, lease};
        claim.host = host;
        // bind() ignores it: only rebind() takes a name over.
        claim.allows_takeover = replaces || below(2) == 0;
        const auto result = replaces ? store.rebind(claim, now) : store.bind(claim, now);
        ASSERT_EQ(
            answer_of(result),
            model.bind({.name = name, .url = url, .interface = {}, .owner = owner, .host = host},
                       lease, replaces, now));
        break;
      }
      case 3:
        ASSERT_EQ(answer_of(store.renew(name, owner, lease, now)),
                  model.renew(name, owner, lease, now));
        break;
      case 4:
        ASSERT_EQ(answer_of(store.unbind(name, owner, now)), model.unbind(name, owner));
        break;
      case 5: {
        const auto result = store.resolve(name, now);
        Answer answer = answer_of(result);
        if (result) {
          answer.names = {(*result)->name, (*result)->url,
                          std::to_string(to_ns((*result)->expires))};
        }
        ASSERT_EQ(answer, model.resolve(name));
        break;
      }
      default: {
        const std::string directory = below(3) == 0 ? "" : name;
        Answer listed;
        std::string after;
        for (bool is_last = false; !is_last;) {
          const auto page = store.list(directory, after, 1 + below(3), now);
          ASSERT_TRUE(page);
          for (const Record* record : page->records)
            listed.names.push_back(record->name);
          is_last = page->is_last;
          if (!listed.names.empty()) after = listed.names.back();
        }
        ASSERT_EQ(listed, model.list(directory));
        ASSERT_EQ(store.size(), model.list("").names.size());
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, StoreProperty, testing::Range(0U, 50U));

}  // namespace
}  // namespace rtpm::names
