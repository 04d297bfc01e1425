// What Python cannot reach of the pool: exceptions of tasks, and that every index is visited once. Compiled and run
// by test_processes.py; exits with 0, or prints the line that fails.
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "parallel.h"

using namespace room2dgs;

#define CHECK(condition)                                             \
  do {                                                               \
    if (!(condition)) {                                              \
      std::printf("line %d: %s does not hold\n", __LINE__, #condition); \
      std::fflush(stdout);                                           \
      _exit(1);                                                      \
    }                                                                \
  } while (0)

static void every_index_once(int64_t count) {
  std::vector<std::atomic<int>> visits(count);
  Region region;
  std::atomic<bool> inside{true};
  region.parallel_for(count, [&](int64_t index, int worker) {
    ++visits[index];
    if (worker < 0 || worker >= region.workers()) inside = false;
  });
  CHECK(inside);
  for (auto& visit : visits) CHECK(visit == 1);
}

static void exception_reaches_the_caller(int64_t bad) {
  std::string caught;
  std::atomic<int> running{0};
  try {
    parallel_for(1000, [&](int64_t index, int) {
      ++running;
      struct Leave {
        std::atomic<int>& n;
        ~Leave() { --n; }
      } leave{running};
      if (index == bad) throw std::runtime_error("task " + std::to_string(index));
      std::this_thread::yield();
    });
  } catch (const std::runtime_error& error) {
    caught = error.what();
    CHECK(running == 0);  // no task is left that could write to what the caller gives back
  }
  CHECK(caught == "task " + std::to_string(bad));
}

int main() {
  for (int count : {1, 2, 3, 8}) {
    CHECK(set_threads(count) == count && threads() == count);
    for (int64_t tasks : {0, 1, 2, 7, 1000}) every_index_once(tasks);
    for (int64_t bad : {0, 1, 500, 999}) {
      exception_reaches_the_caller(bad);
      every_index_once(50);  // and the pool works on
    }
  }
  // several at once fail, one is told
  int failures = 0;
  try {
    parallel_for(100, [](int64_t, int) { throw std::logic_error("all"); });
  } catch (const std::logic_error&) {
    ++failures;
  }
  CHECK(failures == 1);

  std::atomic<bool> done{false};
  std::thread resizer([&] {
    for (int k = 0; !done; ++k) set_threads(1 + k % 6);
  });
  std::vector<std::thread> callers;
  for (int k = 0; k < 3; ++k)
    callers.emplace_back([] {
      for (int round = 0; round < 50; ++round) every_index_once(200);
    });
  for (std::thread& caller : callers) caller.join();
  done = true;
  resizer.join();

  set_threads(4);
  const pid_t child = fork();
  if (child == 0) {
    CHECK(threads() == 1);
    every_index_once(100);
    CHECK(set_threads(3) == 3);
    every_index_once(100);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  every_index_once(100);
  return 0;
}
