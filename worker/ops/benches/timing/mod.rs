//! What the benchmarks share: pseudo-random numbers, and times that hardly depend on the load of
//! the machine.

// Each benchmark is a separate program and uses a part of this module.
#![allow(dead_code)]

use cpu_time::ThreadTime;
use std::time::Duration;

/// A number in [0, 1], different for each `i`.
pub(crate) fn noise(i: usize) -> f32 {
    let hash = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (hash ^ hash >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9) as u32 as f32 / u32::MAX as f32
}

/// `count` numbers in [0, `scale`].
pub(crate) fn many(count: usize, scale: f32) -> Vec<f32> {
    (0..count).map(|i| scale * noise(i)).collect()
}

/// Shortest processor time of each of the works on this thread, milliseconds. They run in turn,
/// `runs` times.
pub(crate) fn shortest<const N: usize>(runs: usize, mut works: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut best = [Duration::MAX; N];
    for _ in 0..runs {
        for (work, best) in works.iter_mut().zip(&mut best) {
            let start = ThreadTime::now();
            work();
            *best = (*best).min(start.elapsed());
        }
    }
    best.map(|time| 1e3 * time.as_secs_f64())
}

/// Prints a line of a table: an operation, its milliseconds, those of Burn's operations, and the
/// ratio.
pub(crate) fn line(name: &str, [ours, burns]: [f64; 2]) {
    println!("{name:<32} {ours:>8.2} {burns:>10.2} {:>7.1}", burns / ours);
}

/// Prints the heading of the table.
pub(crate) fn heading() {
    println!(
        "{:<32} {:>8} {:>10} {:>7}",
        "operation", "ours ms", "Burn's ms", "ratio"
    );
}

/// Runs `measure` and the operations' tasks on one thread, whose processor time is then that of all
/// work.
pub(crate) fn on_one_thread(
    measure: impl FnOnce() + Send,
) -> Result<(), rayon::ThreadPoolBuildError> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()?
        .install(measure);
    Ok(())
}
