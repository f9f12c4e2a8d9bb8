-- precision, recall and F1 per class, metric and threshold: mean over seeds, +- of 95 % confidence
with counted as (
  select building, storey, scan, variant, seed, class, metric, threshold,
         bool_or(simulated) as simulated,
         count(true_id) as n_true,
         count(found_id) as n_found,
         count(*) filter (true_id is not null and found_id is not null) as n_matched,
         avg(value) as mean_value,
         avg((true_class is not distinct from found_class)::int)
           filter (true_id is not null and found_id is not null and true_class is not null)
           as class_accuracy,
         avg(abs(width_error_m)) as width_error_m
  from detections
  group by building, storey, scan, variant, seed, class, metric, threshold
),
scored as (
  select *,
         -- null where nothing was found, or nothing is there to be found
         n_matched / nullif(n_found, 0) as p,
         n_matched / nullif(n_true, 0) as r,
         2 * n_matched / (n_found + n_true) as f
  from counted
),
student as (
  -- two-sided 95 % quantiles of Student's t for 1, 2, ... degrees of freedom
  select [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179,
          2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064,
          2.060, 2.056, 2.052, 2.048, 2.045] as t
)
select building, storey, scan, variant, class, metric, threshold,
       bool_or(simulated) as simulated,
       count(*) as seeds,
       sum(n_true) as n_true,
       sum(n_found) as n_found,
       sum(n_matched) as n_matched,
       round(avg(p), 4) as precision,
       round(avg(r), 4) as recall,
       round(avg(f), 4) as f1,
       -- null of a single seed; a normal quantile beyond 30
       round(stddev_samp(p) / sqrt(count(p)) * coalesce(any_value(t)[count(p) - 1], 1.96), 4)
         as precision_pm,
       round(stddev_samp(r) / sqrt(count(r)) * coalesce(any_value(t)[count(r) - 1], 1.96), 4)
         as recall_pm,
       round(stddev_samp(f) / sqrt(count(f)) * coalesce(any_value(t)[count(f) - 1], 1.96), 4)
         as f1_pm,
       round(avg(mean_value), 4) as mean_value,
       round(avg(class_accuracy), 4) as class_accuracy,
       round(avg(width_error_m), 4) as width_error_m
from scored, student
group by building, storey, scan, variant, class, metric, threshold
order by building, storey, scan nulls first, variant, class, metric, threshold
