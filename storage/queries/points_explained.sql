-- labelled points against the plan: completeness and intersection over union per class and distance
select building, storey, variant, class, buffer_m,
       bool_or(simulated) as simulated,
       count(*) as seeds,
       cast(sum(true_points) as bigint) as true_points,
       round(avg(completeness), 4) as completeness,
       round(avg(iou), 4) as iou
from point_quality
group by building, storey, variant, class, buffer_m
order by building, storey, variant, class, buffer_m
