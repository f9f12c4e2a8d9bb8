-- precision, recall and F1 per class, metric and threshold: mean over seeds, +- of 95 % confidence
with counted as (
  select building, storey, scan, variant, seed, run, class, metric, threshold,
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
  group by building, storey, scan, variant, seed, run, class, metric, threshold
),
scored as (
  select *,
         -- null where nothing was found, or nothing is there to be found
         n_matched / nullif(n_found, 0) as p,
         n_matched / nullif(n_true, 0) as r,
         2 * n_matched / (n_found + n_true) as f
  from counted
)
select building, storey, scan, variant, class, metric, threshold,
       bool_or(simulated) as simulated,
       count(*) as seeds,
       cast(sum(n_true) as bigint) as n_true,
       cast(sum(n_found) as bigint) as n_found,
       cast(sum(n_matched) as bigint) as n_matched,
       round(avg(p), 4) as precision,
       round(avg(r), 4) as recall,
       round(avg(f), 4) as f1,
       -- null of a single seed
       round(confidence95(p), 4) as precision_pm,
       round(confidence95(r), 4) as recall_pm,
       round(confidence95(f), 4) as f1_pm,
       round(avg(mean_value), 4) as mean_value,
       round(avg(class_accuracy), 4) as class_accuracy,
       round(avg(width_error_m), 4) as width_error_m
from scored
group by building, storey, scan, variant, class, metric, threshold
order by building, storey, scan nulls first, variant, class, metric, threshold
