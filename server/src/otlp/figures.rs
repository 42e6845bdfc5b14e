//! Figures as messages of OTLP. Their names and units become those of `/metrics` again where a collector writes them for
//! Prometheus.

#![expect(
    deprecated,
    reason = "the module that comes after it, `prometheus_protobuf`, makes integers real numbers"
)]

use super::attributes::text;
use opentelemetry_proto::tonic::common::v1::KeyValue;
use opentelemetry_proto::tonic::metrics::v1::metric::Data;
use opentelemetry_proto::tonic::metrics::v1::number_data_point::Value as Number;
use opentelemetry_proto::tonic::metrics::v1::{
    AggregationTemporality, Gauge, Histogram, HistogramDataPoint, Metric, NumberDataPoint, Sum,
};
use prometheus_client::encoding::openmetrics_protobuf::{
    self, openmetrics_data_model as registered,
};
use prometheus_client::registry::Registry;
use registered::metric_point::Value;
use registered::{Label, MetricFamily, MetricType, counter_value, gauge_value, histogram_value};
use std::fmt;

const CUMULATIVE: i32 = AggregationTemporality::Cumulative as i32;

/// A time from `start` until `now`, nanoseconds since 1970.
#[derive(Debug, Clone, Copy)]
pub(super) struct Period {
    /// When the counters were 0.
    pub start: u64,
    /// When they were read.
    pub now: u64,
}

/// The messages of the families of `registry`, which are read at the end of `period`.
///
/// # Errors
/// Never in practice: when a gauge is above the largest integer.
pub(super) fn metrics(registry: &Registry, period: Period) -> Result<Vec<Metric>, fmt::Error> {
    let families = openmetrics_protobuf::encode(registry)?.metric_families;
    Ok(families.iter().map(|it| metric(it, period)).collect())
}

fn metric(family: &MetricFamily, period: Period) -> Metric {
    let numbers = |start| {
        let points = points(family);
        let points = points.filter_map(|(labels, value)| {
            Some(NumberDataPoint {
                attributes: attributes(labels),
                start_time_unix_nano: start,
                time_unix_nano: period.now,
                value: Some(number(value)?),
                ..NumberDataPoint::default()
            })
        });
        points.collect()
    };
    let data = match family.r#type() {
        MetricType::Counter => Data::Sum(Sum {
            data_points: numbers(period.start),
            aggregation_temporality: CUMULATIVE,
            is_monotonic: true,
        }),
        MetricType::Histogram => Data::Histogram(Histogram {
            data_points: points(family)
                .filter_map(|(labels, value)| histogram(labels, value, period))
                .collect(),
            aggregation_temporality: CUMULATIVE,
        }),
        // No other type is registered. A gauge has no start.
        _ => Data::Gauge(Gauge {
            data_points: numbers(0),
        }),
    };
    Metric {
        name: name(family),
        description: family.help.clone(),
        unit: unit(&family.unit).to_owned(),
        data: Some(data),
        ..Metric::default()
    }
}

/// The name with its unit, as `/metrics` has it.
fn name(family: &MetricFamily) -> String {
    match family.unit.as_str() {
        "" => family.name.clone(),
        unit => format!("{}_{unit}", family.name),
    }
}

/// The unit's code in UCUM, which OpenTelemetry has; others are as they are.
fn unit(name: &str) -> &str {
    match name {
        "seconds" => "s",
        "bytes" => "By",
        other => other,
    }
}

/// The values of a family and their labels.
fn points(family: &MetricFamily) -> impl Iterator<Item = (&[Label], &Value)> {
    family.metrics.iter().flat_map(|metric| {
        let values = metric.metric_points.iter();
        let values = values.filter_map(|it| it.value.as_ref());
        values.map(|it| (metric.labels.as_slice(), it))
    })
}

fn attributes(labels: &[Label]) -> Vec<KeyValue> {
    labels.iter().map(|it| text(&it.name, &it.value)).collect()
}

/// The number of a counter or a gauge.
fn number(value: &Value) -> Option<Number> {
    Some(match value {
        Value::CounterValue(counter) => match counter.total? {
            counter_value::Total::IntValue(it) => {
                Number::AsInt(i64::try_from(it).unwrap_or(i64::MAX))
            }
            counter_value::Total::DoubleValue(it) => Number::AsDouble(it),
        },
        Value::GaugeValue(gauge) => match gauge.value? {
            gauge_value::Value::IntValue(it) => Number::AsInt(it),
            gauge_value::Value::DoubleValue(it) => Number::AsDouble(it),
        },
        _ => return None,
    })
}

fn histogram(labels: &[Label], value: &Value, period: Period) -> Option<HistogramDataPoint> {
    let Value::HistogramValue(value) = value else {
        return None;
    };
    let bounds = value.buckets.iter().map(|it| it.upper_bound);
    Some(HistogramDataPoint {
        attributes: attributes(labels),
        start_time_unix_nano: period.start,
        time_unix_nano: period.now,
        count: value.count,
        sum: value.sum.map(|it| match it {
            histogram_value::Sum::DoubleValue(it) => it,
            histogram_value::Sum::IntValue(it) => it as f64,
        }),
        // In both messages, a bucket counts its own values alone. The last one has no upper bound.
        bucket_counts: value.buckets.iter().map(|it| it.count).collect(),
        explicit_bounds: bounds.filter(|it| it.is_finite()).collect(),
        ..HistogramDataPoint::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use prometheus_client::encoding::text::encode;
    use prometheus_client::metrics::counter::Counter;
    use prometheus_client::metrics::family::Family;
    use prometheus_client::metrics::gauge::Gauge as Registered;
    use prometheus_client::metrics::histogram::Histogram as Observed;
    use prometheus_client::registry::Unit;
    use std::sync::atomic::AtomicU64;

    const PERIOD: Period = Period { start: 5, now: 9 };
    /// A label that has to be escaped in text.
    const ODD: &str = r#"a "b", \n} c=""#;

    /// A registry with each type of metric.
    fn registry() -> Registry {
        let mut registry = Registry::with_prefix("y");
        let leases = Family::<Vec<(String, String)>, Counter>::default();
        let labels = vec![("kind".to_owned(), ODD.to_owned())];
        leases.get_or_create(&labels).inc_by(3);
        registry.register("leases", "Leases", leases);
        let free = Registered::<f64, AtomicU64>::default();
        free.set(1.5);
        registry.register_with_unit("free", "Room", Unit::Bytes, free);
        let ready = Registered::<i64>::default();
        ready.set(-1);
        registry.register("ready", "Whether it serves", ready);
        let took = Observed::new([0.5, 2.0]);
        for seconds in [0.25, 0.75, 1.0, 2.0, 2.5, 3.0] {
            took.observe(seconds);
        }
        registry.register_with_unit("took", "Time", Unit::Seconds, took);
        registry
    }

    #[test]
    fn names_are_those_of_the_text() {
        let registry = registry();
        let mut shown = String::new();
        encode(&mut shown, &registry).expect("is written");
        let types = shown.lines().filter_map(|it| it.strip_prefix("# TYPE "));
        let names = types.map(|it| it.split(' ').next().expect("a name").to_owned());
        let metrics = metrics(&registry, PERIOD).expect("fits");
        let sent: Vec<_> = metrics.iter().map(|it| it.name.clone()).collect();
        assert_eq!(sent, names.collect::<Vec<_>>());
        assert!(shown.contains(&format!("# HELP y_leases {}\n", metrics[0].description)));
    }

    #[test]
    fn each_kind_has_its_form() {
        let metrics = metrics(&registry(), PERIOD).expect("fits");
        let names = metrics.iter().map(|it| (&*it.name, &*it.unit));
        let expected = [
            ("y_leases", ""),
            ("y_free_bytes", "By"),
            ("y_ready", ""),
            ("y_took_seconds", "s"),
        ];
        assert_eq!(names.collect::<Vec<_>>(), expected);

        let Some(Data::Sum(sum)) = &metrics[0].data else {
            panic!("{:?}", metrics[0]);
        };
        assert!(sum.is_monotonic && sum.aggregation_temporality == CUMULATIVE);
        let leases = &sum.data_points[0];
        assert_eq!(leases.attributes, [text("kind", ODD)]);
        assert_eq!((leases.start_time_unix_nano, leases.time_unix_nano), (5, 9));
        assert_eq!(leases.value, Some(Number::AsInt(3)));

        let Some(Data::Gauge(gauge)) = &metrics[1].data else {
            panic!("{:?}", metrics[1]);
        };
        let free = &gauge.data_points[0];
        assert_eq!(free.value, Some(Number::AsDouble(1.5)));
        assert_eq!(free.start_time_unix_nano, 0);

        let Some(Data::Gauge(gauge)) = &metrics[2].data else {
            panic!("{:?}", metrics[2]);
        };
        assert_eq!(gauge.data_points[0].value, Some(Number::AsInt(-1)));

        let Some(Data::Histogram(histogram)) = &metrics[3].data else {
            panic!("{:?}", metrics[3]);
        };
        let took = &histogram.data_points[0];
        assert_eq!((took.count, took.sum), (6, Some(9.5)));
        assert_eq!(took.explicit_bounds, [0.5, 2.0]);
        assert_eq!(took.bucket_counts, [1, 3, 2]);
    }
}
