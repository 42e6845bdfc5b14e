//! Distribution of a step's time: sums the durations of the model's trace spans, by name.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tracing::Subscriber;
use tracing::span::{Attributes, Id};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::{Context, SubscriberExt};
use tracing_subscriber::registry::LookupSpan;

/// Seconds by span name. Nested spans count in both.
pub(super) type Seconds = BTreeMap<&'static str, f64>;

#[derive(Clone, Default)]
struct Sums(Arc<Mutex<Seconds>>);

struct Entered(Instant);

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Sums {
    fn on_new_span(&self, _: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id) {
            span.extensions_mut().insert(Entered(Instant::now()));
        }
    }

    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id) {
            span.extensions_mut().replace(Entered(Instant::now()));
        }
    }

    fn on_exit(&self, id: &Id, context: Context<'_, S>) {
        let Some(span) = context.span(id) else { return };
        if let Some(Entered(since)) = span.extensions().get() {
            let mut sums = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            *sums.entry(span.name()).or_default() += since.elapsed().as_secs_f64();
        }
    }
}

/// Runs `work` on this thread and returns the durations of its spans.
pub(super) fn timed<T>(work: impl FnOnce() -> T) -> (T, Seconds) {
    let sums = Sums::default();
    let subscriber = tracing_subscriber::registry().with(sums.clone());
    let result = tracing::subscriber::with_default(subscriber, work);
    let seconds = std::mem::take(&mut *sums.0.lock().unwrap_or_else(PoisonError::into_inner));
    (result, seconds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn spans_are_summed_by_name() {
        let (value, seconds) = timed(|| {
            for _ in 0..2 {
                let _outer = tracing::trace_span!("outer").entered();
                tracing::trace_span!("inner")
                    .in_scope(|| std::thread::sleep(Duration::from_millis(2)));
            }
            7
        });
        assert_eq!(value, 7);
        assert_eq!(
            seconds.keys().copied().collect::<Vec<_>>(),
            ["inner", "outer"]
        );
        assert!(seconds["inner"] >= 0.004 && seconds["outer"] >= seconds["inner"]);
    }
}
