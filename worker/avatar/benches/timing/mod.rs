//! What the benchmarks share: numbers without a pattern, and times that hardly show what else the
//! machine does.

// Each benchmark is a program of its own and takes what it needs.
#![allow(dead_code)]

use cpu_time::ThreadTime;
use std::time::Duration;

/// In [0, 1), another for each `i`.
pub fn noise(i: usize) -> f32 {
    let hash = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (hash ^ hash >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9) as u32 as f32 / u32::MAX as f32
}

/// `count` of them, times `scale`.
pub fn many(count: usize, scale: f32) -> Vec<f32> {
    (0..count).map(|i| scale * noise(i)).collect()
}

/// Shortest milliseconds of this thread's processor time of each work, taken in turn `runs` times.
pub fn shortest<const N: usize>(runs: usize, mut works: [&mut dyn FnMut(); N]) -> [f64; N] {
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

/// A line of a table: an operation, its milliseconds, those of Burn's operations, and the ratio.
pub fn line(name: &str, [ours, burns]: [f64; 2]) {
    println!("{name:<32} {ours:>8.2} {burns:>10.2} {:>7.1}", burns / ours);
}

/// The heading over such lines.
pub fn heading() {
    println!(
        "{:<32} {:>8} {:>10} {:>7}",
        "operation", "ours ms", "Burn's ms", "ratio"
    );
}

/// Runs `measure` on one thread, operations' own threads too, so that its time is the whole.
pub fn on_one_thread(measure: impl FnOnce() + Send) -> Result<(), rayon::ThreadPoolBuildError> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()?
        .install(measure);
    Ok(())
}
