// A small pool of threads. Work is cut into tasks by the caller and never by the number of threads, and every task
// writes to its own place: that is what makes results the same bits on any number of threads.
#pragma once

#include <cstdint>
#include <mutex>

namespace room2dgs {

constexpr int kMaxThreads = 1024;

// Asks for `count` threads from now on, the caller's own included; waits for a region that is open.
// Gives the number in use, which is smaller where the system refuses to start as many.
int set_threads(int count);
int threads();

struct Pool;

// The pool, held by one caller: nobody resizes it while a region is open, so scratch for `workers()` suits every task
// that runs in it. Regions of several threads wait for one another. Not reentrant; the interpreter's lock must not be
// taken inside, since another thread may hold it while it waits for the region.
class Region {
 public:
  Region();
  int workers() const;

  // Calls body(index, worker) for every index in [0, count), worker < workers(), and blocks until all are done. Tasks
  // are handed out in rising order, dynamically. The first exception of a task reaches the caller, once no task runs
  // any more; tasks that have not begun are dropped then.
  template <class Body>
  void parallel_for(int64_t count, const Body& body) {
    run(count, const_cast<Body*>(&body),
        [](void* context, int64_t index, int worker) { (*static_cast<const Body*>(context))(index, worker); });
  }

 private:
  void run(int64_t count, void* context, void (*task)(void*, int64_t, int));
  Pool& pool_;
  std::unique_lock<std::mutex> lock_;
};

// A region with one loop.
template <class Body>
void parallel_for(int64_t count, const Body& body) {
  if (count > 0) Region().parallel_for(count, body);
}

}  // namespace room2dgs
