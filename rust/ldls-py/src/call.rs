//! How Python calls the core: without the GIL, on a thread pool, and with panics turned into `InternalError`.

use crate::errors::{raise, to_python};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// Most threads of a pool.
const MAX_THREADS: usize = 1024;

type Pools = HashMap<(u32, usize), Arc<ThreadPool>>;
/// Pools by process and size: threads do not survive a fork, so a child makes its own. Pools are never dropped, which
/// would wait for threads that a child does not have. Locked under the GIL only, which a fork from Python holds too.
static POOLS: LazyLock<Mutex<Pools>> = LazyLock::new(Mutex::default);
/// Where and why the last panic happened.
static LAST_PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Runs `work` on `threads` threads (`None`: as many as the process may use) with the GIL released.
pub fn run<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    work: impl FnOnce() -> ldls_core::Result<T> + Send,
) -> PyResult<T> {
    let pool = pool(py, threads)?;
    let outcome = py.detach(|| catch_unwind(AssertUnwindSafe(|| pool.install(work))));
    match outcome {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(to_python(py, &error)),
        Err(payload) => Err(internal_error(py, payload.as_ref())),
    }
}

/// Number of threads where none is asked for: `LDLS_NUM_THREADS`, or the cores that the process may use by affinity
/// and container quota.
#[pyfunction]
pub fn default_threads(py: Python<'_>) -> PyResult<usize> {
    let Ok(text) = std::env::var("LDLS_NUM_THREADS") else {
        return Ok(std::thread::available_parallelism().map_or(1, usize::from));
    };
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
    run(py, None, || panic!("panic asked for"))
}

/// Keeps the place of a panic for the message, instead of printing it.
pub fn remember_panics() {
    std::panic::set_hook(Box::new(|info| {
        let place = info
            .location()
            .map_or_else(|| "an unknown place".to_owned(), ToString::to_string);
        *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = Some(place);
    }));
}

fn pool(py: Python<'_>, threads: Option<usize>) -> PyResult<Arc<ThreadPool>> {
    let threads = match threads {
        Some(threads @ 1..=MAX_THREADS) => threads,
        Some(threads) => {
            return Err(raise(
                py,
                "ParameterError",
                &format!("threads: got {threads}, expected 1 to {MAX_THREADS}"),
            ));
        }
        None => default_threads(py)?,
    };
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let key = (std::process::id(), threads);
    if let Some(pool) = pools.get(&key) {
        return Ok(Arc::clone(pool));
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|i| format!("ldls-{i}"))
        .start_handler(keep_to_own_core(threads))
        .build()
        .map_err(|error| {
            raise(
                py,
                "LimitError",
                &format!("threads: cannot start {threads}: {error}"),
            )
        })?;
    Ok(Arc::clone(
        pools.entry(key).or_insert_with(|| Arc::new(pool)),
    ))
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
    let place = LAST_PANIC
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .take();
    let place = place.unwrap_or_else(|| "an unknown place".to_owned());
    raise(
        py,
        "InternalError",
        &format!("{what} (at {place}); this is a bug in ldls, please report it with this line"),
    )
}
