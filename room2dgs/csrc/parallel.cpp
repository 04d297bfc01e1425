#include "parallel.h"

#include <atomic>
#include <condition_variable>
#include <exception>
#include <new>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#if defined(__unix__)
#include <pthread.h>
#endif

namespace room2dgs {

struct Pool {
  std::mutex region;  // held by one `Region` at a time; guards `workers`
  std::mutex mutex;   // guards what follows
  std::condition_variable wake, finished;
  std::vector<std::thread> workers;
  uint64_t generation = 0;
  int running = 0;
  bool stopping = false;
  std::exception_ptr failure;

  int64_t count = 0;
  void* context = nullptr;
  void (*task)(void*, int64_t, int) = nullptr;
  std::atomic<int64_t> next{0};

  void drain(int worker) {
    try {
      for (int64_t index = next.fetch_add(1); index < count; index = next.fetch_add(1)) task(context, index, worker);
    } catch (...) {
      next = count;  // nobody begins another task
      std::lock_guard<std::mutex> lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  }

  void loop(int worker, uint64_t seen) {
    for (;;) {
      {
        std::unique_lock<std::mutex> lock(mutex);
        wake.wait(lock, [&] { return stopping || generation != seen; });
        if (stopping) return;
        seen = generation;
      }
      drain(worker);
      std::lock_guard<std::mutex> lock(mutex);
      if (--running == 0) finished.notify_one();
    }
  }

  void resize(int helpers) {
    {
      std::lock_guard<std::mutex> lock(mutex);
      stopping = true;
    }
    wake.notify_all();
    for (std::thread& worker : workers) worker.join();
    workers.clear();
    stopping = false;
    try {
      workers.reserve(helpers);
      for (int k = 0; k < helpers; ++k) workers.emplace_back(&Pool::loop, this, k + 1, generation);
    } catch (const std::system_error&) {  // no more threads, or no room for their stacks: those that started do
    } catch (const std::bad_alloc&) {
    }
  }
};

namespace {

// Never destroyed: joining threads while the interpreter unloads can hang.
Pool* pool = new Pool;
std::atomic<int> thread_count{1};

#if defined(__unix__)
// A forked child has none of the parent's threads: start afresh there.
void after_fork_in_child() {
  pool = new Pool;
  thread_count = 1;
}
const int registered = pthread_atfork(nullptr, nullptr, after_fork_in_child);
#endif

}  // namespace

int set_threads(int count) {
  std::lock_guard<std::mutex> region(pool->region);
  pool->resize(count - 1);
  return thread_count = static_cast<int>(pool->workers.size()) + 1;
}

int threads() { return thread_count; }

Region::Region() : pool_(*pool), lock_(pool_.region) {}

int Region::workers() const { return static_cast<int>(pool_.workers.size()) + 1; }

void Region::run(int64_t count, void* context, void (*task)(void*, int64_t, int)) {
  if (pool_.workers.empty() || count <= 1) {
    for (int64_t index = 0; index < count; ++index) task(context, index, 0);
    return;
  }
  {
    std::lock_guard<std::mutex> lock(pool_.mutex);
    pool_.count = count;
    pool_.context = context;
    pool_.task = task;
    pool_.next = 0;
    pool_.running = static_cast<int>(pool_.workers.size());
    ++pool_.generation;
  }
  pool_.wake.notify_all();
  pool_.drain(0);
  std::unique_lock<std::mutex> lock(pool_.mutex);
  pool_.finished.wait(lock, [&] { return pool_.running == 0; });
  if (std::exception_ptr failure = std::exchange(pool_.failure, nullptr)) std::rethrow_exception(failure);
}

}  // namespace room2dgs
