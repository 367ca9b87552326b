//! Calls of the core from Python: without the GIL, on a thread pool, stopped by Ctrl-C, and with panics turned into
//! `InternalError`.

use crate::allocator::{has_ballast, take_ballast};
use crate::errors::{out_of_memory, raise, to_python};
use ldls_core::Cancel;
use pyo3::intern;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How often the caller's thread looks for signals and for a lack of memory.
const LOOK: Duration = Duration::from_millis(20);
/// Most threads of a pool.
const MAX_THREADS: usize = 1024;

/// Pools of one thread that nobody uses, each with the process that it is of.
static SINGLE_THREADS: Mutex<Vec<(u32, ThreadPool)>> = Mutex::new(Vec::new());

type Pools = HashMap<(u32, usize), Arc<ThreadPool>>;
/// Pools by process and size: threads do not survive a fork, so a child makes its own. Pools are never dropped, which
/// would wait for threads that a child does not have. Locked under the GIL only, which a fork from Python holds too.
static POOLS: LazyLock<Mutex<Pools>> = LazyLock::new(Mutex::default);
/// Place of the last panic.
static LAST_PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Runs `work` on `threads` threads (`None`: as many as the process may use) with the GIL released.
///
/// Calls at the same time share the threads of a pool, so that frames from several Python threads do not take more than
/// one frame would; those with `threads` 1 run beside one another, each on a thread of its own.
pub fn run<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    work: impl FnOnce(&Cancel) -> ldls_core::Result<T> + Send,
) -> PyResult<T> {
    let threads = checked_threads(py, threads)?;
    check_memory()?;
    let outcome = if threads == 1 {
        let pool = idle_thread(py)?;
        let outcome = on_pool(py, &pool, work);
        lock(&SINGLE_THREADS).push((std::process::id(), pool));
        outcome
    } else {
        let pool = shared_pool(py, threads)?;
        on_pool(py, &pool, work)
    };
    unwrapped(py, outcome?)
}

/// Runs `work`, which is short and knows nothing of threads, here and now, with the GIL released.
pub fn run_here<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> ldls_core::Result<T> + Send,
) -> PyResult<T> {
    check_memory()?;
    let outcome = py.detach(|| catch_unwind(AssertUnwindSafe(work)));
    unwrapped(py, outcome)
}

/// Runs `work`, which takes microseconds, with the GIL held: giving it away and waiting for it would take longer.
pub fn run_at_once<T>(py: Python<'_>, work: impl FnOnce() -> ldls_core::Result<T>) -> PyResult<T> {
    unwrapped(py, catch_unwind(AssertUnwindSafe(work)))
}

fn unwrapped<T>(py: Python<'_>, outcome: std::thread::Result<ldls_core::Result<T>>) -> PyResult<T> {
    match outcome {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(to_python(py, &error)),
        Err(payload) => Err(internal_error(py, payload.as_ref())),
    }
}

fn check_memory() -> PyResult<()> {
    if take_ballast() {
        return Ok(());
    }
    Err(out_of_memory("not enough memory to begin; free some"))
}

/// Runs `work` on the first thread of `pool`: always the same one, so that what a frame took from the allocator's store
/// of that thread lies there for the next frame. The other threads share in what it divides. The caller's thread looks
/// after signals meanwhile, and stops the work at one that raises an exception, as Ctrl-C does.
fn on_pool<T: Send>(
    py: Python<'_>,
    pool: &ThreadPool,
    work: impl FnOnce(&Cancel) -> T + Send,
) -> PyResult<std::thread::Result<T>> {
    let (work, cancel) = (Mutex::new(Some(work)), Cancel::default());
    let (outcome, done) = (Mutex::new(None), Condvar::new());
    let gets_signals = is_main_thread(py)?;
    let stopped = py.detach(|| {
        pool.in_place_scope(|scope| {
            scope.spawn_broadcast(|_, thread| {
                let work = (thread.index() == 0).then(|| lock(&work).take());
                if let Some(work) = work.flatten() {
                    let found = catch_unwind(AssertUnwindSafe(|| work(&cancel)));
                    *lock(&outcome) = Some(found);
                    done.notify_one();
                }
            });
            let mut found = lock(&outcome);
            while found.is_none() {
                let waited = done.wait_timeout(found, LOOK);
                found = waited.unwrap_or_else(PoisonError::into_inner).0;
                if found.is_none() {
                    drop(found);
                    if let Err(error) = look_around(gets_signals) {
                        cancel.cancel();
                        return Err(error);
                    }
                    found = lock(&outcome);
                }
            }
            Ok(())
        })
    });
    stopped?;
    let outcome = outcome.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(outcome.expect("a pool has a first thread"))
}

/// True in the one thread that Python calls handlers of signals in.
fn is_main_thread(py: Python<'_>) -> PyResult<bool> {
    let threading = py.import(intern!(py, "threading"))?;
    let main = threading.call_method0(intern!(py, "main_thread"))?;
    let own = threading.call_method0(intern!(py, "get_ident"))?;
    main.getattr(intern!(py, "ident"))?.eq(own)
}

/// The exception that a signal raises, where this thread gets them, or that there is next to no memory left. Other threads keep
/// away from the interpreter, which may end at that moment: the process would end by a fault of memory.
fn look_around(gets_signals: bool) -> PyResult<()> {
    if gets_signals {
        let signals = |py: Python<'_>| py.check_signals();
        Python::try_attach(signals).unwrap_or(Ok(()))?;
    }
    if has_ballast() {
        return Ok(());
    }
    Err(out_of_memory(
        "not enough memory; split the cloud, or free memory",
    ))
}

/// Number of threads where none is asked for: `LDLS_NUM_THREADS`, or the cores that the process may use by affinity
/// and container quota.
#[pyfunction]
pub fn default_threads(py: Python<'_>) -> PyResult<usize> {
    let Some(text) = std::env::var_os("LDLS_NUM_THREADS") else {
        return Ok(std::thread::available_parallelism().map_or(1, usize::from));
    };
    let text = text.to_string_lossy();
    if let Ok(threads @ 1..=MAX_THREADS) = text.trim().parse() {
        return Ok(threads);
    }
    let message =
        format!("LDLS_NUM_THREADS: got {text:?}, expected a whole number from 1 to {MAX_THREADS}");
    Err(raise(py, "ParameterError", &message))
}

/// Panics in a worker thread: for the test of what users then see.
#[pyfunction]
pub fn panic_in_worker(py: Python<'_>) -> PyResult<()> {
    run(py, None, |_| panic!("panic asked for"))
}

/// Keeps the place of a panic for the message, instead of printing it.
pub fn remember_panics() {
    std::panic::set_hook(Box::new(|info| {
        let place = info
            .location()
            .map_or_else(|| "an unknown place".to_owned(), ToString::to_string);
        *lock(&LAST_PANIC) = Some(place);
    }));
}

/// The number of threads asked for, if a pool may have so many.
pub fn checked_threads(py: Python<'_>, threads: Option<usize>) -> PyResult<usize> {
    match threads {
        Some(threads @ 1..=MAX_THREADS) => Ok(threads),
        Some(threads) => {
            let message = format!("threads: got {threads}, expected 1 to {MAX_THREADS}");
            Err(raise(py, "ParameterError", &message))
        }
        None => default_threads(py),
    }
}

/// The pool of `threads` threads of this process.
fn shared_pool(py: Python<'_>, threads: usize) -> PyResult<Arc<ThreadPool>> {
    let mut pools = lock(&POOLS);
    let key = (std::process::id(), threads);
    if let Some(pool) = pools.get(&key) {
        return Ok(Arc::clone(pool));
    }
    let pool = Arc::new(new_pool(py, threads)?);
    pools.insert(key, Arc::clone(&pool));
    Ok(pool)
}

/// A pool of one thread of this process that nobody uses.
fn idle_thread(py: Python<'_>) -> PyResult<ThreadPool> {
    let mut idle = lock(&SINGLE_THREADS);
    let own = idle
        .iter()
        .position(|(process, _)| *process == std::process::id());
    own.map_or_else(|| new_pool(py, 1), |at| Ok(idle.swap_remove(at).1))
}

fn new_pool(py: Python<'_>, threads: usize) -> PyResult<ThreadPool> {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|i| format!("ldls-{i}"))
        .start_handler(keep_to_own_core(threads))
        .build()
        .map_err(|error| {
            let message = format!("threads: cannot start {threads}: {error}");
            raise(py, "LimitError", &message)
        })
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ties each thread of a pool to a core, if the pool has one for every core that the process may use.
///
/// Virtual machines wake a sleeping thread on the core of the one that wakes it and leave both there for
/// milliseconds, while the other core idles: a frame then takes as long as on one thread.
fn keep_to_own_core(threads: usize) -> impl Fn(usize) + Send + Sync {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    move |thread| {
        if cores.len() == threads {
            core_affinity::set_for_current(cores[thread]);
        }
    }
}

fn internal_error(py: Python<'_>, payload: &(dyn Any + Send)) -> PyErr {
    let what = payload
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a panic without a message".to_owned());
    let place = lock(&LAST_PANIC).take();
    let place = place.unwrap_or_else(|| "an unknown place".to_owned());
    raise(
        py,
        "InternalError",
        &format!("{what} (at {place}); this is a bug in ldls, please report it with this line"),
    )
}
