-- |true - found| room area per storey and plan compared (initial, final): mean, median, p95, worst
select building, storey, scan, variant,
       bool_or(simulated) as simulated,
       count(distinct coalesce(seed, -1)) as seeds,
       count(true_id) as n_true,
       count(found_id) as n_found,
       count(value) as n_matched,
       round(avg(abs(true_m2 - found_m2)), 4) as mean_m2,
       round(median(abs(true_m2 - found_m2)), 4) as median_m2,
       round(quantile_cont(abs(true_m2 - found_m2), 0.95), 4) as p95_m2,
       round(max(abs(true_m2 - found_m2)), 4) as worst_m2,
       round(100 * avg(abs(true_m2 - found_m2) / true_m2), 2) as mean_percent,
       round(100 * sum(abs(true_m2 - found_m2)) / sum(true_m2) filter (value is not null), 2)
         as area_percent,
       round(avg(value), 4) as mean_iou
from detections
-- every room with the one it shares most area with: the worst must not be left out
where class = 'room' and metric = 'iou' and threshold = 0
group by building, storey, scan, variant
order by building, storey, scan nulls first, variant
