-- rooms found whose class is the true one, per storey: mean over seeds, +- of 95 % confidence
with counted as (
  select building, storey, scan, variant, seed, run, threshold,
         bool_or(simulated) as simulated,
         count(*) as n_rooms,
         avg((true_class is not distinct from found_class)::int) as accuracy
  from detections
  where class = 'room' and metric = 'iou' and threshold > 0
    and true_id is not null and found_id is not null and true_class is not null
  group by building, storey, scan, variant, seed, run, threshold
)
select building, storey, scan, variant, threshold,
       bool_or(simulated) as simulated,
       count(*) as seeds,
       cast(sum(n_rooms) as bigint) as n_rooms,
       round(avg(accuracy), 4) as accuracy,
       -- null of a single seed
       round(confidence95(accuracy), 4) as accuracy_pm
from counted
group by building, storey, scan, variant, threshold
order by building, storey, scan nulls first, variant, threshold
