//! A job that shows no sign of life: its thread hangs in a driver or a deadlock, which nothing in this
//! process can end. Its worker must, so that the job runs elsewhere.

use super::control::JobControl;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::time::sleep;
use yoto_proto::v1::Progress;

/// Steps of the job's own speed for which it may be silent.
const STEPS: f64 = 20.0;
/// Pause between two looks at the job.
const LOOK: Duration = Duration::from_secs(1);
/// Longest time that counts as silence between two looks: a process that was stopped, or a machine that
/// slept, is no proof that the job hangs.
const LONGEST_LOOK: Duration = Duration::from_secs(2);

/// Returns once the job has shown no sign of life for longer than its speed explains; the silence.
/// `shortest` is always allowed.
pub(super) async fn silence(
    control: &JobControl,
    progress: watch::Receiver<Progress>,
    shortest: Duration,
) -> Duration {
    let mut silence = Silence::new(shortest);
    loop {
        let looked = Instant::now();
        sleep(LOOK).await;
        let speed = progress.borrow().steps_per_second;
        if let Some(silent) = silence.look(control.signs(), looked.elapsed(), speed) {
            return silent;
        }
    }
}

/// The time without a sign of life.
#[derive(Debug)]
struct Silence {
    shortest: Duration,
    signs: u64,
    lasts: Duration,
}

impl Silence {
    fn new(shortest: Duration) -> Self {
        Self {
            shortest,
            signs: 0,
            lasts: Duration::ZERO,
        }
    }

    /// Looks at the number of `signs`, some time after the last look; the silence, once it is too long for
    /// a job of this speed.
    fn look(&mut self, signs: u64, passed: Duration, steps_per_second: f64) -> Option<Duration> {
        if signs == self.signs {
            self.lasts += passed.min(LONGEST_LOOK);
        } else {
            (self.signs, self.lasts) = (signs, Duration::ZERO);
        }
        (self.lasts > self.allowed(steps_per_second)).then_some(self.lasts)
    }

    /// The allowed silence of a job at this speed; 0 steps per second: unknown.
    fn allowed(&self, steps_per_second: f64) -> Duration {
        let steps = Duration::try_from_secs_f64(STEPS / steps_per_second);
        // Neither an unknown speed nor one below any that makes sense extends it.
        steps.map_or(self.shortest, |steps| steps.max(self.shortest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn minute() -> Silence {
        Silence::new(Duration::from_secs(60))
    }

    /// Looks without a sign, a second apart, until the silence is too long.
    fn looks(silence: &mut Silence, signs: u64, speed: f64) -> usize {
        let look = |_: &usize| silence.look(signs, LOOK, speed).is_none();
        (1..1000).take_while(look).count() + 1
    }

    #[test]
    fn a_job_without_signs_is_silent_for_longer_than_its_steps_take() {
        assert_eq!(looks(&mut minute(), 0, 0.0), 61);
        assert_eq!(looks(&mut minute(), 0, f64::NAN), 61);
        assert_eq!(looks(&mut minute(), 0, 10.0), 61);
        assert_eq!(looks(&mut minute(), 0, 0.1), 201);
    }

    #[test]
    fn a_sign_ends_a_silence() {
        let mut silence = minute();
        for signs in 1..100 {
            for _ in 0..59 {
                assert_eq!(silence.look(signs, LOOK, 0.0), None);
            }
        }
    }

    #[test]
    fn a_process_that_was_stopped_for_an_hour_is_no_silent_job() {
        let mut silence = minute();
        assert_eq!(silence.look(0, Duration::from_secs(3600), 0.0), None);
    }
}
